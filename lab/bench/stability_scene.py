"""All decode paths of a scene, in all precisions, against float64; and with texture coordinates that are no numbers."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import get_args

import numpy as np

from lab.bench.float64_error import float64_pixels
from lab.bench.stability import StabilityRow
from ntc.codec.precision import Precision
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.render.resources.precision import supported_precisions
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import DecodePath, Slot, ViewState

HOSTILE_UV = (np.nan, np.inf, -np.inf, 1e6, -1e6, 3e38, 1e-40, 0.5)
SAMPLES = 1024


def hostile_scene(scene: Scene) -> Scene:
    """`scene` with texture coordinates that are no numbers, or far away, at every vertex."""
    values = np.resize(np.array(HOSTILE_UV, np.float32), scene.geometry.uvs.shape[0] + 1)
    uvs = np.stack([values[:-1], values[1:]], axis=-1)
    return replace(scene, geometry=replace(scene.geometry, uvs=uvs))


def scene_rows(
    context: GraphicsContext,
    scene: Scene,
    packs: Mapping[str, Pack],
    camera: Camera,
    size: tuple[int, int],
    precisions: tuple[Precision, ...],
    progress: Callable[[str], None],
) -> list[StabilityRow]:
    """`camera`'s picture of `scene` by every path: with its own texture coordinates, then with hostile ones."""
    rows = []
    emulate = set(precisions) - set(supported_precisions(context)) != set()
    for name, own in (("scene", scene), ("scene, uv NaN, Inf, 1e6, 3e38", hostile_scene(scene))):
        renderer = Renderer(context, own, emulate_half=emulate)
        renderer.set_packs(packs)
        for source in packs:
            for path in get_args(DecodePath):
                for precision in precisions:
                    case = f"{name}: {source}"
                    progress(f"{case}, {path}, {precision}")
                    rows.append(
                        _row(renderer, case, packs[source], ViewState(camera, size, Slot(source, path, precision)))
                    )
        renderer.release()
    return rows


def _row(renderer: Renderer, case: str, pack: Pack, view: ViewState) -> StabilityRow:
    slot = view.slot_a
    renderer.render(view, whole=True)
    albedo = renderer.albedo(slot)
    largest = rms = psnr = None
    if case.startswith("scene:"):
        match = renderer.matches[slot.source]
        found = float64_pixels(renderer.visibility, renderer.scene, pack, match, slot.path, SAMPLES).compare(albedo)
        largest, psnr = found.largest, found.psnr_db
        rms = None if psnr is None else float(10.0 ** (-psnr / 20.0))
    return StabilityRow(
        case=case,
        path=slot.path,
        precision=slot.precision,
        texels=albedo.shape[0] * albedo.shape[1],
        largest=largest,
        rms=rms,
        psnr_db=psnr,
        ulps=None,
        not_finite=int((~np.isfinite(albedo)).sum()),
    )
