"""Stability of decode paths and precisions: their errors against float64 and against certified bounds, case by case."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lab.bench.fixture import DecodeFixture, FixturePath, PackLoader
from lab.bench.float64_error import float64_pixels
from lab.bench.stability_cases import Requests, StabilityCase, as_single
from lab.bench.tiles import Tiling
from ntc.codec.config import Precision
from ntc.codec.grid.accuracy.error_bound import running_bounds
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.reference import decode_texels
from ntc.codec.registry import codec_of
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder
from viewer.render.renderer import Renderer
from viewer.render.resources.decoding_shaders import supported_precisions
from viewer.render.resources.layout import MATERIAL_SHIFT
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import EXACT_PATHS, Slot, ViewState

Array = NDArray[np.float64]
HOSTILE_UV = (np.nan, np.inf, -np.inf, 1e6, -1e6, 3e38, 1e-40, 0.5)
SCENE_SAMPLES = 1024
"""Number of pixels of a scene's picture that are decoded in float64."""
FIXTURE_SIDE = 64
"""Side in pixels of the picture that paths decode. Each pixel shows one texel of a case."""
LOGARITHM_ERROR = 2.0**-14
"""Error bound of log2 in shaders, for footprints that occur."""
ULP_FLOOR = 1.0 / 255.0
"""Lower limit of the values whose units in the last place measure errors, because units near 0 are arbitrarily small."""


@dataclass(frozen=True)
class StabilityRow:
    """Errors of one case by one path in one precision."""

    case: str
    path: str
    precision: Precision
    texels: int
    largest: float | None
    """Largest error against float64, in [0, 1] of the texture's colour space; None where only NaN and infinity were counted."""
    rms: float | None
    psnr_db: float | None
    """PSNR of the error, peak 1; None for no error."""
    ulps: float | None
    """Largest error in units in the last place of the exact value in fp32; None for other precisions."""
    not_finite: int
    """Number of values that are NaN or infinite; must be 0."""
    bound: float | None = None
    """Largest bound of a texel; None for paths that filter or convert decoded values, and for codec `block`."""
    holds: bool | None = None
    """Whether the error of every texel is within the bound of that texel."""


@dataclass(frozen=True, eq=False)
class _Expected:
    exact: Array
    bound: Array | None
    """Certified bounds of `exact`; None for codec `block`, which has none."""


def _row(case: str, path: str, precision: Precision, values: NDArray[np.float32], expected: _Expected) -> StabilityRow:
    error = np.abs(values.astype(np.float64) - expected.exact)
    finite = np.isfinite(error)
    square = float(np.mean(error[finite] ** 2)) if finite.any() else 0.0
    units = np.spacing(np.maximum(np.abs(expected.exact), ULP_FLOOR).astype(np.float32)).astype(np.float64)
    return StabilityRow(
        case=case,
        path=path,
        precision=precision,
        texels=len(values),
        largest=float(error[finite].max(initial=0.0)),
        rms=math.sqrt(square),
        psnr_db=finite_or_none(-10.0 * math.log10(square) if square > 0.0 else math.inf),
        ulps=float((error / units)[finite].max(initial=0.0)) if precision == "fp32" else None,
        not_finite=int((~np.isfinite(values)).sum()),
        bound=None if expected.bound is None else float(expected.bound.max(initial=0.0)),
        holds=None if expected.bound is None else bool((error <= expected.bound).all()),
    )


def _expected(case: StabilityCase, precision: Precision, lod_error: float = 0.0) -> _Expected:
    stored = codec_of(case.pack.config).stored_pack(case.pack, precision) if case.rescale else case.pack
    exact, bound = [], []
    for part in case.requests:
        values = decode_texels(case.pack, part.texture, part.uv, part.lod)
        if not isinstance(case.pack.config, GridConfig):
            exact.append(_padded(values))
            continue
        bounds = running_bounds(stored, part.texture, part.uv, part.lod, precision, lod_error)
        # Textures with fewer channels than the widest are padded: missing channels are exact.
        exact.append(_padded(values))
        bound.append(_padded(bounds))
    return _Expected(np.concatenate(exact), np.concatenate(bound) if bound else None)


def _padded(values: NDArray[np.floating]) -> Array:
    """Return [N, 3] values of [N, 1 to 4]: missing channels are 0, a fourth is dropped."""
    wide = np.zeros((len(values), 3))
    wide[:, : min(3, values.shape[1])] = values[:, :3]
    return wide


class StabilityBench:
    """Decoder of cases on one context. It compiles programs once for each codec and precision."""

    def __init__(self, context: GraphicsContext) -> None:
        self._context = context
        self._loader = PackLoader(context)

    def _emulated(self, precision: Precision) -> bool:
        return precision not in supported_precisions(self._context)

    def texel_decoder(self, pack: Pack, precision: Precision, rescale: bool = True) -> GlTexelDecoder:
        """Return a decoder of single texels of `pack`. The caller releases it."""
        emulated = self._emulated(precision)
        return GlTexelDecoder(self._context, pack, precision, emulated, self._loader.programs, rescale)

    def texels(self, case: StabilityCase, precision: Precision) -> StabilityRow:
        """Return the row of `case` by the texel decoder, which `ntc-viewer decode` uses."""
        decoder = self.texel_decoder(case.pack, precision, case.rescale)
        values = [_padded(decoder.decode_texels(part.texture, part.uv, part.lod)) for part in case.requests]
        decoder.release()
        return _row(
            case.name, "texels", precision, np.concatenate(values).astype(np.float32), _expected(case, precision)
        )

    def pictures(
        self, case: StabilityCase, precision: Precision, paths: Sequence[FixturePath]
    ) -> Iterator[StabilityRow]:
        """Yield the rows of `case` by each of `paths`, decoded as a picture whose pixels show as many of its texels as fit."""
        seen = _as_seen(case)
        expected = _expected(seen, precision, LOGARITHM_ERROR)
        fixture = DecodeFixture(self._context, Tiling((FIXTURE_SIDE, FIXTURE_SIDE), 1), _words(seen))
        loaded = self._loader.load(seen.pack, precision, self._emulated(precision))
        for path in paths:
            fixture.decoding(loaded, path)()
            # The target is read with row 0 on top, but the words were written with row 0 at the bottom.
            albedo = fixture.target.read()[::-1].reshape(-1, 3)[: len(expected.exact)]
            self._context.reset.check()
            yield _row(case.name, path, precision, albedo, expected)
        loaded.release()
        fixture.release()

    def release(self) -> None:
        """Free all programs."""
        self._loader.release()


def fixture_paths(case: StabilityCase) -> tuple[FixturePath, ...]:
    """Return the paths of a fixture that can decode `case`."""
    if not case.rescale:
        return ()
    return ("deferred", "deferred, shared", "binned") if len(case.pack.decoders) == 1 else ("deferred", "binned")


def _as_seen(case: StabilityCase) -> StabilityCase:
    """Return `case` as a fixture shows it: repeated, not converted from sRGB, with some of its texels, and with lods of footprints."""
    pack: Pack = replace(
        case.pack,
        textures=tuple(replace(t, color_space="linear", wrap=("repeat", "repeat")) for t in case.pack.textures),
    )
    left = FIXTURE_SIDE * FIXTURE_SIDE
    each = max(1, left // len(case.requests))
    requests = []
    for part in case.requests:
        count = min(each, left, len(part.lod))
        width = pack.textures[part.texture].width
        footprint = _footprint(part.lod[:count], width)
        with np.errstate(invalid="ignore", over="ignore"):
            texels = np.maximum(as_single(footprint * width), 1e-10)
        # GLSL leaves max with NaN undefined. Drivers return the other operand.
        texels = np.where(np.isnan(footprint), 1e-10, texels)
        with np.errstate(divide="ignore", invalid="ignore"):
            requests.append(Requests(part.texture, part.uv[:count], np.log2(texels)))
        left -= count
    return replace(case, pack=pack, requests=[part for part in requests if len(part.lod)])


def _footprint(lod: Array, width: int) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):
        return as_single(np.exp2(lod) / width)


def _words(seen: StabilityCase) -> NDArray[np.uint32]:
    """Return [FIXTURE_SIDE, FIXTURE_SIDE, 4] visibility words of the case's texels, pixel by pixel; the rest is background."""
    words = np.zeros((FIXTURE_SIDE * FIXTURE_SIDE, 4), np.uint32)
    first = 0
    for part in seen.requests:
        rows = slice(first, first + len(part.lod))
        width = seen.pack.textures[part.texture].width
        with np.errstate(over="ignore", invalid="ignore"):
            footprint = (np.exp2(part.lod) / width).astype(np.float32)
        words[rows, 0] = (part.texture + 1) | (1 << MATERIAL_SHIFT)
        words[rows, 1:3] = part.uv.astype(np.float32).view(np.uint32)
        words[rows, 3] = footprint.view(np.uint32)
        first += len(part.lod)
    return words.reshape(FIXTURE_SIDE, FIXTURE_SIDE, 4)


Progress = Callable[[str], None]


def computed_precisions(pack: Pack, precisions: Sequence[Precision]) -> Sequence[Precision]:
    """Return the different precisions in which `pack` is computed. A codec may compute several of `precisions` in fp32."""
    codec = codec_of(pack.config)
    return tuple(dict.fromkeys(codec.gpu_tables(pack.config, each).precision for each in precisions))


def stability_rows(
    bench: StabilityBench, cases: Sequence[StabilityCase], precisions: Sequence[Precision], progress: Progress
) -> list[StabilityRow]:
    """Return the rows of all `cases` by the texel decoder and by the paths of a fixture, in all `precisions`."""
    rows = []
    for case in cases:
        progress(case.name)
        for precision in computed_precisions(case.pack, precisions):
            rows.append(bench.texels(case, precision))
            rows += bench.pictures(case, precision, fixture_paths(case))
    return rows


def hostile_scene(scene: Scene) -> Scene:
    """Return `scene` with NaN, infinite or huge texture coordinates at every vertex."""
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
    """Return the rows of the picture of `scene` from `camera` by every path, with original and then with hostile coordinates."""
    rows = []
    emulate = set(precisions) - set(supported_precisions(context)) != set()
    for name, drawn_scene in (("scene", scene), ("scene, uv NaN, Inf, 1e6, 3e38", hostile_scene(scene))):
        renderer = Renderer(context, drawn_scene, emulate_half=emulate)
        renderer.set_packs(packs)
        for source in packs:
            for path in EXACT_PATHS:
                for precision in computed_precisions(packs[source], precisions):
                    case = f"{name}: {source}"
                    progress(f"{case}, {path}, {precision}")
                    rows.append(
                        _scene_row(
                            renderer, case, packs[source], ViewState(camera, size, Slot(source, path, precision))
                        )
                    )
        renderer.release()
    return rows


def _scene_row(renderer: Renderer, case: str, pack: Pack, view: ViewState) -> StabilityRow:
    slot = view.slot_a
    renderer.render(view, whole=True)
    # The base plane has only the surfaces of the visibility buffer; the picture at rest also has BLEND surfaces.
    albedo = renderer.planes(slot)["base"][..., :3]
    largest = rms = psnr = None
    if case.startswith("scene:"):
        match = renderer.matches[slot.source]
        error = float64_pixels(renderer.visibility, renderer.scene, pack, match, slot.path, SCENE_SAMPLES).compare(
            albedo
        )
        largest, psnr = error.largest, error.psnr_db
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
