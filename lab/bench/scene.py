"""Benchmark of a scene: time and error of every pack by path and precision, over the scene's cameras."""

import math
import statistics
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from lab.bench.float64_error import Float64Pixels, float64_pixels
from lab.bench.interleaved import Progress, no_progress, spread_of, warm_up_rounds
from ntc.codec.gpu import VariantName
from ntc.codec.mips import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none, psnr_db
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from ntc.metrics.image_quality import flip
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.render.resources.decoding_shaders import EVERYWHERE
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import (
    FILTERED_PATHS,
    REFERENCE,
    DecodePath,
    Overlay,
    Precision,
    Slot,
    TexelFilter,
    ViewState,
    is_image_source,
)

NUDGE = 1e-4
"""Movement of the camera between frames, as a share of its distance to the target. A still camera would skip passes."""
PLACES = 7
"""Number of positions between which a moved camera alternates."""
PICTURE_BYTES = 16 + 4 + 4 + 4 + 8 + 2 * 16 + 4
"""Largest memory in bytes per pixel: visibility words, colour, depth, composite, albedo of reference and both slots, binned list."""


@dataclass(frozen=True)
class SceneBenchConfig:
    """Settings of the benchmark of a scene."""

    size: tuple[int, int] = (640, 360)
    paths: tuple[DecodePath, ...] = get_args(DecodePath)
    precisions: tuple[Precision, ...] = EVERYWHERE
    repeats: int = 5
    formats: tuple[BlockFormat, ...] = ()
    """Block formats of graphics hardware to measure beside the packs."""
    filters: tuple[TexelFilter, ...] = ("exact",)


@dataclass(frozen=True)
class SceneBenchRow:
    """Row of the benchmark: times and errors of one slot from one camera."""

    camera: str
    source: str
    path: str
    precision: str
    filter: str
    decode_ms: float
    """Median time of the decode or reference pass; with the stochastic filter, that of one sample."""
    min_ms: float
    max_ms: float
    frame_ms: float
    """Median of all passes together."""
    passes_ms: Mapping[str, float]
    """Medians by pass."""
    decoded_pixels: int
    excess: int
    psnr_db: float | None
    """PSNR against the reference picture: covered pixels, 8-bit sRGB; None where equal and for the reference."""
    flip: float | None
    """Mean FLIP against the reference picture."""
    reference_step: int | None
    """Largest difference of a channel of a covered pixel from the reference picture, in 8-bit steps; None for the reference."""
    float64_max: float | None
    """Largest difference of a decoded value, in [0, 1] before rounding to 8 bits, from the float64 decode of sampled pixels.

    All figures named `float64` are None for the stochastic filter, which only approaches that decode."""
    float64_psnr_db: float | None
    """PSNR of the same values; None where equal."""
    float64_step: int | None
    """Largest difference of the picture to the float64 decode, in 8-bit steps."""
    float64_pixels: int
    """Number of sampled pixels."""
    largest_step: int | None
    """Largest difference of a channel from the pack's first slot (`deferred` in fp32, if timed), in 8-bit steps."""


def nudged(camera: Camera, frame: int) -> Camera:
    """Return `camera` moved sideways a little, differently for each of PLACES successive frames."""
    x, y, z = camera.eye
    tx, _, tz = camera.target
    step = NUDGE * (frame % PLACES + 1)
    return replace(camera, eye=(x + step * (tz - z), y, z - step * (tx - x)))


def bench_slots(packs: Sequence[str], config: SceneBenchConfig) -> tuple[Slot, ...]:
    """Return the slots to time: the reference, the block formats, and every pack by path, precision and filter.

    `deferred` in fp32 with the exact filter is the first slot of each pack.
    """
    paths = sorted(config.paths, key=lambda path: path != "deferred")
    precisions = sorted(config.precisions, key=lambda precision: precision != "fp32")
    filters = sorted(config.filters)
    decoded = [
        Slot(pack, path, precision, filtered if path not in FILTERED_PATHS else "exact")
        for pack in packs
        for path in paths
        for precision in precisions
        for filtered in filters
    ]
    formats = [Slot(block_format) for block_format in config.formats]
    return (Slot(REFERENCE), *formats, *dict.fromkeys(decoded))


def interleaved(slots: Sequence[Slot], camera: Camera, rounds: int) -> Sequence[tuple[int, Slot, Camera]]:
    """Return (round, slot, camera) of every frame in order, with each slot once per round.

    Two successive frames, or two successive frames of one slot, have different cameras, because equal ones would skip passes.
    """
    stride = len(slots) + (len(slots) % PLACES == 0)
    return [
        (number, slot, nudged(camera, number * stride + turn))
        for number in range(rounds)
        for turn, slot in enumerate(slots)
    ]


def bench_scene(
    context: GraphicsContext,
    scene: Scene,
    packs: Mapping[str, Pack],
    cameras: Sequence[Camera],
    config: SceneBenchConfig,
    progress: Progress = no_progress,
    compressed: Mapping[BlockFormat, CompressedTextures] | None = None,
    variant: VariantName | None = None,
) -> tuple[SceneBenchRow, ...]:
    """Time and compare all slots, and return a row for each camera and slot.

    `compressed` has the scene's textures in the formats of `config`. Slots are timed interleaved, frame by frame; the first rounds
    warm up.
    """
    renderer = Renderer(context, scene, variant=variant)
    renderer.set_packs(packs)
    renderer.images.set_compressed(compressed or {})
    slots = bench_slots(list(packs), config)
    warm_up = warm_up_rounds(context)
    rows: list[SceneBenchRow] = []
    rounds = warm_up + config.repeats
    for number, camera in enumerate(cameras):
        times: dict[Slot, list[Mapping[str, float]]] = defaultdict(list)
        for turn, slot, moved in interleaved(slots, camera, rounds):
            timings = renderer.render(ViewState(moved, config.size, slot)).timings_ms
            if turn >= warm_up:
                times[slot].append(timings)
            if slot == slots[-1]:
                progress(number * rounds + turn + 1, len(cameras) * rounds)
        rows += _measured(renderer, packs, camera, slots, times, config)
    renderer.release()
    return tuple(rows)


def _measured(
    renderer: Renderer,
    packs: Mapping[str, Pack],
    camera: Camera,
    slots: Sequence[Slot],
    times: Mapping[Slot, Sequence[Mapping[str, float]]],
    config: SceneBenchConfig,
) -> list[SceneBenchRow]:
    renderer.render(ViewState(camera, config.size, Slot(REFERENCE)))
    truth, covered, textures = (linear_to_srgb8(renderer.picture(Slot())), renderer.covered(), renderer.texture_ids())
    twins: dict[tuple[str, bool], Float64Pixels] = {}
    first: dict[str, NDArray[np.uint8]] = {}
    rows = []
    for slot in slots:
        result = renderer.render(ViewState(camera, config.size, slot, overlay=Overlay("divergence")))
        albedo = renderer.picture(slot)
        shown = linear_to_srgb8(albedo)
        is_reference, is_image = slot.source == REFERENCE, is_image_source(slot.source)
        twin = None
        if not is_image and slot.filter == "exact":
            key = (slot.source, slot.path in FILTERED_PATHS)
            if key not in twins:
                pack, match = packs[slot.source], renderer.matches[slot.source]
                twins[key] = float64_pixels(renderer.visibility, renderer.scene, pack, match, slot.path)
            # The base plane has only the surfaces of the visibility buffer; the picture at rest also has BLEND surfaces.
            twin = twins[key].compare(renderer.planes(slot)["base"][..., :3])
        name = slot.source if is_image else f"decode_{slot.path}"
        decode = spread_of([entry.get(name, 0.0) for entry in times[slot]])
        decoders = np.array([*renderer.decoders(slot.source), -1])[textures]
        first.setdefault(slot.source, shown)
        step = _steps(shown, first[slot.source])
        quality = psnr_db(shown[covered], truth[covered]) if covered.any() and not is_reference else math.inf
        rows.append(
            SceneBenchRow(
                camera=camera.name,
                source=slot.source,
                path="" if is_image else slot.path,
                precision="" if is_image else slot.precision,
                filter="" if is_image else slot.filter,
                decode_ms=decode.median_ms,
                min_ms=decode.min_ms,
                max_ms=decode.max_ms,
                frame_ms=statistics.median(sum(entry.values()) for entry in times[slot]),
                passes_ms={
                    key: statistics.median(entry.get(key, 0.0) for entry in times[slot]) for key in times[slot][0]
                },
                decoded_pixels=int((decoders >= 0).sum()),
                excess=result.divergence[slot.source].excess if slot.source in result.divergence else 0,
                psnr_db=finite_or_none(quality),
                flip=None if is_reference else flip(truth, shown),
                reference_step=None if is_reference else _steps(shown[covered], truth[covered]),
                float64_max=None if twin is None else twin.largest,
                float64_psnr_db=None if twin is None else twin.psnr_db,
                float64_step=None if twin is None else twin.largest_step,
                float64_pixels=0 if twin is None else twin.pixels,
                largest_step=None if is_image else step,
            )
        )
    return rows


def _steps(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> int:
    """Return the largest difference between two arrays of one shape; 0 for empty ones."""
    return int(np.abs(a.astype(int) - b.astype(int)).max(initial=0))
