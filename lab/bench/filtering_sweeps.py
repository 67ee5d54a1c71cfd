"""How well each path filters: pictures against a supersampled truth while a surface shrinks, tilts, and a camera moves."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb
from viewer.render.passes.accumulate import SAMPLES
from viewer.render.renderer import Renderer
from viewer.scene.bounds import world_bounds
from viewer.scene.model import Camera, Geometry, Instances, Material, Primitive, Scene
from viewer.state.navigation import turned
from viewer.state.view_state import EXACT_PATHS, REFERENCE, Anisotropy, PathChoice, Slot, ViewState

SUPERSAMPLES = 4
"""Samples of the ground truth along each side of a pixel."""
FLOOR_SIDE = 400.0
"""Side of the square in view, in widths of its texture's image."""
FOV_DEGREES = 40.0

Picture = NDArray[np.float64]


@dataclass(frozen=True)
class FilteringConfig:
    """Views to measure."""

    size: tuple[int, int] = (128, 96)
    texels_per_pixel: tuple[float, ...] = (0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0)
    """Texels a pixel of a square seen straight on; below 1 it is magnified."""
    tilts: tuple[float, ...] = (0.0, 30.0, 50.0, 65.0, 75.0, 82.0)
    """Degrees between its normal and the direction of view, at a texel a pixel in the middle."""
    frames: int = 10
    degrees_per_frame: float = 0.15
    textures: int = 3
    """Number of textures, spread over the scene's table."""


@dataclass(frozen=True)
class Way:
    """A way to draw the picture: slot and filter."""

    name: str
    slot: Slot
    anisotropy: Anisotropy = 1
    whole: bool = True
    """Whether the picture is drawn to the end; else the stochastic filter takes one sample."""


@dataclass(frozen=True)
class FilteringRow:
    """One way to make a picture, at one place of a sweep."""

    sweep: str
    """`shrinking`, `tilting` or `moving`."""
    value: float
    """Texels a pixel; degrees; number of the frame."""
    way: str
    psnr_db: float
    """Against the supersampled originals: covered pixels, 8-bit sRGB range without rounding; mean over the textures' MSE."""
    flicker: float | None
    """`moving`: RMS change of the error from the frame before, in 8-bit steps."""


def ways(sources: Mapping[str, str]) -> tuple[Way, ...]:
    """Those of `ways_of` for each source, named by its label; of several sources only by the paths that filter differently."""
    if len(sources) == 1:
        return ways_of(next(iter(sources)), EXACT_PATHS)
    named = [
        replace(way, name=f"{label}: {way.name}" if way.slot.source == source else way.name)
        for source, label in sources.items()
        for way in ways_of(source, ("deferred", "cached"))
    ]
    return tuple(dict.fromkeys(named))


def ways_of(source: str, paths: Sequence[PathChoice]) -> tuple[Way, ...]:
    """The reference and `source` by each path, trilinear; those that can, anisotropic too; one with the stochastic filter."""
    decoded = [Way(path, Slot(source, path)) for path in paths]
    if "deferred" in paths:
        # One sample first: the others are added to it.
        sampled = Slot(source, "deferred", filter="stochastic")
        decoded += [Way("deferred, 1 sample", sampled, whole=False), Way(f"deferred, {SAMPLES} samples", sampled)]
    anisotropic = [Way("reference, anisotropic", Slot(REFERENCE), 8)]
    if "cached" in paths:
        anisotropic.append(Way("cached, anisotropic", Slot(source, "cached"), 8))
    return (Way("reference", Slot(REFERENCE)), *decoded, *anisotropic)


def floor_scene(scene: Scene, textures: Sequence[int]) -> Scene:
    """Large squares, one below the other, each covered with one texture of `scene`, repeated."""
    half = FLOOR_SIDE / 2.0
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]], np.float32)
    positions, uvs, primitives, materials = [], [], [], []
    for number, texture in enumerate(textures):
        width, height = scene.textures[texture].size
        positions.append(corners - np.array([0, 0, number * 2.0 * FLOOR_SIDE], np.float32))
        uvs.append(corners[:, :2] * np.array([1.0, -width / height], np.float32))
        primitives.append(Primitive(f"floor {number}", number * 6, 6, number * 4, 4, number))
        materials.append(Material(f"floor {number}", texture, (1.0, 1.0, 1.0, 1.0)))
    count = len(primitives)
    indices = np.tile(np.array([0, 1, 2, 0, 2, 3], np.uint32), count)
    geometry = Geometry(np.concatenate(positions), np.concatenate(uvs), None, indices)
    transforms = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))
    instances = Instances(np.arange(count, dtype=np.int32), transforms, np.zeros(count, np.int32))
    bounds = world_bounds(geometry, primitives, instances)
    return replace(
        scene,
        geometry=geometry,
        primitives=tuple(primitives),
        instances=instances,
        materials=tuple(materials),
        cameras=(),
        bounds=bounds,
    )


def floor_camera(number: int, width: int, texels_per_pixel: float, tilt: float, pixels: int) -> Camera:
    """Looks at square `number`, whose image is `width` texels wide, at `tilt` degrees; `pixels` is the picture's height."""
    distance = texels_per_pixel / width * pixels / (2.0 * math.tan(math.radians(FOV_DEGREES) / 2.0))
    ground = -number * 2.0 * FLOOR_SIDE
    # Off the middle, so that no texel's edge falls onto a pixel's edge everywhere.
    target = (0.137, 0.211, ground)
    angle = math.radians(tilt)
    eye = (target[0], target[1] - distance * math.sin(angle), ground + distance * math.cos(angle))
    return Camera("floor", eye, target, fov_degrees=FOV_DEGREES, near=distance * 0.05, far=distance * 200.0)


def supersampled(renderer: Renderer, camera: Camera, size: tuple[int, int]) -> tuple[Picture, NDArray[np.bool_]]:
    """([H, W, 3] sRGB-coded truth in [0, 1], [H, W] where all of a pixel is covered): the originals, many samples a pixel."""
    large = (size[0] * SUPERSAMPLES, size[1] * SUPERSAMPLES)
    renderer.render(ViewState(camera, large, Slot(REFERENCE)))
    blocks = (size[1], SUPERSAMPLES, size[0], SUPERSAMPLES)
    linear = renderer.picture(Slot(REFERENCE)).astype(np.float64).reshape(*blocks, 3).mean(axis=(1, 3))
    covered = np.asarray(renderer.covered().reshape(blocks).all(axis=(1, 3)), np.bool_)
    return np.asarray(linear_to_srgb(linear), np.float64), covered


def shown(renderer: Renderer, camera: Camera, size: tuple[int, int], way: Way) -> Picture:
    """[H, W, 3] sRGB-coded in [0, 1]."""
    renderer.render(ViewState(camera, size, way.slot, anisotropy=way.anisotropy), way.whole)
    drawn = renderer.picture(way.slot) if way.whole else renderer.picture_in(way.slot, (0, 0, *size))
    assert drawn is not None
    return np.asarray(linear_to_srgb(drawn.astype(np.float64)), np.float64)


def _psnr(squares: Sequence[float]) -> float:
    return -10.0 * math.log10(max(float(np.mean(squares)), 1e-10))


def floor_sweeps(
    renderer: Renderer,
    scene: Scene,
    textures: Sequence[int],
    all_ways: Sequence[Way],
    config: FilteringConfig,
    progress: Callable[[], None] = lambda: None,
) -> list[FilteringRow]:
    """Rows of `shrinking` and `tilting`; `renderer` draws `floor_scene(scene, textures)`."""
    rows = []
    places = [("shrinking", ratio, ratio, 0.0) for ratio in config.texels_per_pixel]
    places += [("tilting", tilt, 1.0, tilt) for tilt in config.tilts]
    for sweep, value, ratio, tilt in places:
        squares: dict[str, list[float]] = {way.name: [] for way in all_ways}
        for number, texture in enumerate(textures):
            width = scene.textures[texture].size[0]
            camera = floor_camera(number, width, ratio, tilt, config.size[1])
            truth, covered = supersampled(renderer, camera, config.size)
            for way in all_ways:
                error = shown(renderer, camera, config.size, way) - truth
                squares[way.name].append(float(np.mean(error[covered] ** 2)) if covered.any() else 0.0)
        rows += [FilteringRow(sweep, value, way.name, _psnr(squares[way.name]), None) for way in all_ways]
        progress()
    return rows


def motion_sweep(
    renderer: Renderer,
    camera: Camera,
    all_ways: Sequence[Way],
    config: FilteringConfig,
    progress: Callable[[], None] = lambda: None,
) -> list[FilteringRow]:
    """Rows of `moving`: `camera` turns slowly in the scene of `renderer`."""
    rows = []
    before: dict[str, tuple[Picture, NDArray[np.bool_]]] = {}
    for frame in range(config.frames):
        view = turned(camera, config.degrees_per_frame * frame)
        truth, covered = supersampled(renderer, view, config.size)
        for way in all_ways:
            error = shown(renderer, view, config.size, way) - truth
            flicker = None
            if way.name in before:
                last, last_covered = before[way.name]
                both = covered & last_covered
                flicker = float(np.sqrt(np.mean((error - last)[both] ** 2))) * 255.0 if both.any() else 0.0
            before[way.name] = (error, covered)
            square = float(np.mean(error[covered] ** 2)) if covered.any() else 0.0
            rows.append(FilteringRow("moving", float(frame), way.name, _psnr([square]), flicker))
        progress()
    return rows
