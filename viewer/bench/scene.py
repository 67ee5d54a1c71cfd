"""Time against error in a scene: every pack by every path and precision, over the scene's cameras."""

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.color import linear_to_srgb8
from ntc.image_quality import flip
from ntc.metrics import psnr_db
from ntc.pack import Pack
from viewer.renderer import Renderer
from viewer.scene.model import Camera
from viewer.view_state import REFERENCE, DecodePath, Overlay, Precision, Slot, ViewState

NUDGE = 1e-4
"""A camera moves by this share of its distance to the target from frame to frame, so that no pass is skipped."""


@dataclass(frozen=True)
class SceneBenchConfig:
    """What is timed."""

    size: tuple[int, int] = (640, 360)
    paths: tuple[DecodePath, ...] = ("deferred", "forward", "binned")
    precisions: tuple[Precision, ...] = ("fp32", "fp16")
    repeats: int = 5


@dataclass(frozen=True)
class SceneBenchRow:
    """A camera by a slot."""

    camera: str
    source: str
    path: str
    precision: str
    decode_ms: float
    """Median of the pass that gives albedo."""
    least_ms: float
    most_ms: float
    frame_ms: float
    """Median of all passes together."""
    passes_ms: Mapping[str, float]
    """Medians by pass."""
    decoded_pixels: int
    excess: int
    psnr_db: float | None
    """Against the reference picture: covered pixels, 8-bit sRGB; None where equal and for the reference."""
    flip: float | None
    """Mean FLIP against the reference picture."""
    largest_step: int | None
    """Most 8-bit steps that a channel of a pixel is away from the same pack by `deferred` in fp32."""


def nudged(camera: Camera, frame: int) -> Camera:
    """`camera` moved sideways a little, differently for each frame."""
    x, y, z = camera.eye
    tx, _, tz = camera.target
    step = NUDGE * (frame % 7 + 1)
    return replace(camera, eye=(x + step * (tz - z), y, z - step * (tx - x)))


def bench_slots(packs: Sequence[str], config: SceneBenchConfig) -> tuple[Slot, ...]:
    """The reference, then every pack by every path in every precision."""
    decoded = [
        Slot(pack, path, precision) for pack in packs for path in config.paths for precision in config.precisions
    ]
    return (Slot(REFERENCE), *decoded)


def bench_scene(
    renderer: Renderer,
    packs: Mapping[str, Pack],
    cameras: Sequence[Camera],
    config: SceneBenchConfig,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> tuple[SceneBenchRow, ...]:
    """A row for each camera and slot. Slots take turns frame by frame, so that drift hits all alike; one round warms up."""
    renderer.set_packs(packs)
    slots = bench_slots(list(packs), config)
    rows: list[SceneBenchRow] = []
    for number, camera in enumerate(cameras):
        times: dict[Slot, list[Mapping[str, float]]] = defaultdict(list)
        for repeat in range(-1, config.repeats):
            for turn, slot in enumerate(slots):
                moved = nudged(camera, repeat * len(slots) + turn)
                timings = renderer.render(ViewState(moved, config.size, slot)).timings_ms
                if repeat >= 0:
                    times[slot].append(timings)
        rows += _measured(renderer, packs, camera, slots, times, config)
        progress(number + 1, len(cameras))
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
    truth, covered, textures = (linear_to_srgb8(renderer.albedo(Slot())), renderer.covered(), renderer.texture_ids())
    exact: dict[str, NDArray[np.uint8]] = {}
    rows = []
    for slot in slots:
        result = renderer.render(ViewState(camera, config.size, slot, overlay=Overlay("divergence")))
        shown = linear_to_srgb8(renderer.albedo(slot))
        is_reference = slot.source == REFERENCE
        name = "reference" if is_reference else f"decode_{slot.path}"
        passes = {key: statistics.median(entry.get(key, 0.0) for entry in times[slot]) for key in times[slot][0]}
        decode = [entry.get(name, 0.0) for entry in times[slot]]
        decoders = np.array([*renderer.decoders(slot.source), -1])[textures]
        exact.setdefault(slot.source, shown)
        step = np.abs(shown.astype(int) - exact[slot.source].astype(int)).max() if not is_reference else None
        quality = psnr_db(shown[covered], truth[covered]) if covered.any() and not is_reference else math.inf
        rows.append(
            SceneBenchRow(
                camera=camera.name,
                source=slot.source,
                path="" if is_reference else slot.path,
                precision="" if is_reference else slot.precision,
                decode_ms=statistics.median(decode),
                least_ms=min(decode),
                most_ms=max(decode),
                frame_ms=statistics.median(sum(entry.values()) for entry in times[slot]),
                passes_ms=passes,
                decoded_pixels=int((decoders >= 0).sum()),
                excess=result.divergence[slot.source].excess if slot.source in result.divergence else 0,
                psnr_db=quality if math.isfinite(quality) else None,
                flip=None if is_reference else flip(truth, shown),
                largest_step=None if step is None else int(step),
            )
        )
    return rows
