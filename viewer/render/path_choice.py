"""Decode path `auto`: it times all paths on the current view, and takes the fastest.

Which path is fastest depends on the GPU, the driver, the codec and its decoders; no rule predicts it (on one GPU, the same arithmetic
ran 30 times slower in fragment shaders than in compute shaders). So each path draws the view PICTURES times while the camera turns a
little. The first picture compiles shaders and fills the tile cache and is not counted; the smallest of the other times is taken,
because disturbances only add time. Paths that decode every pixel take time proportional to the pixels, so they draw a picture with
1/SHARE of the width and height, and their time is scaled up. Path `cached` decodes only tiles that come into sight, which does not
scale with pixels; it is timed at full size. The result is stored by pack, precision and filter
(docs/explanation/decode-paths.md).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, get_args

from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.render.gpu_packs import GpuPacks, on_load_refusal
from viewer.render.picture_targets import PictureTargets, PlaneKey
from viewer.render.render_context import RenderContext
from viewer.render.resources.visibility_buffer import ShownMaterials, SurfaceContent, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.render.slot_drawer import SlotDrawer
from viewer.state.navigation import turned
from viewer.state.view_state import (
    EXACT_PATHS,
    FILTERED_PATHS,
    REFERENCE,
    DecodePath,
    PathChoice,
    Precision,
    Slot,
    TexelFilter,
    ViewState,
    is_image_source,
)

SHARE = 4
"""Factor that reduces width and height of the pictures that time paths which decode every pixel."""
DEGREES = 1.0
"""Turn of the camera between two timed pictures, in degrees. Most tiles of `cached` stay in sight, and some are new."""
COMPUTING: Final[tuple[PathChoice, ...]] = ("deferred", "binned", "cached")
"""Paths that need compute shaders; without these, `forward` replaces them."""
PICTURES = 3
"""Number of pictures that a path draws to be timed; the first is not counted."""


@dataclass(frozen=True)
class PathTimes:
    """Times of the decode paths that `auto` has measured."""

    milliseconds: Mapping[DecodePath, float]
    """Times in ms of a picture of full size after a small turn, by path; paths that cannot be drawn are absent."""

    @property
    def fastest(self) -> DecodePath:
        """Path with the smallest time; `deferred` if none could be timed."""
        return min(self.milliseconds, key=lambda path: self.milliseconds[path], default="deferred")


def time_paths(
    slot_ms: Callable[[ViewState], float],
    view: ViewState,
    slot: Slot,
    paths: Sequence[DecodePath] = EXACT_PATHS,
) -> PathTimes:
    """Return the times of `paths` for `slot`. `slot_ms` draws slot A of a view and returns the time in ms."""
    times: dict[DecodePath, float] = {}
    for path in paths:
        share = 1 if path in FILTERED_PATHS else SHARE
        size = (max(1, view.size[0] // share), max(1, view.size[1] // share))
        plain = replace(view, size=size, slot_a=replace(slot, path=path), compare="a")
        try:
            taken = [
                slot_ms(replace(plain, camera=turned(view.camera, DEGREES * number))) for number in range(PICTURES)
            ]
        except (ShaderError, InputError):
            continue
        times[path] = min(taken[1:]) * (view.size[0] * view.size[1]) / (size[0] * size[1])
    return PathTimes(times)


def drawable_paths(context: GraphicsContext) -> tuple[DecodePath, ...]:
    """Return the paths that this driver can run."""
    paths: tuple[DecodePath, ...] = get_args(DecodePath)
    return paths if context.features.compute else tuple(path for path in paths if path not in (*COMPUTING, "on-load"))


def unsupported_paths(context: GraphicsContext) -> dict[str, str]:
    """Return the paths that this driver cannot run: {path: reason}."""
    version = context.info.version
    reason = f"needs compute shaders (OpenGL 4.3); this driver has {version}. Use forward"
    reasons = {path: reason for path in get_args(DecodePath) if path not in drawable_paths(context)}
    return {path: on_load_refusal(context) if path == "on-load" else reason for path, reason in reasons.items()}


class PathChooser:
    """Choice of path `auto`. It times the paths once for each pack, precision and filter, on separate targets."""

    def __init__(self, context: RenderContext, drawer: SceneDrawer, packs: GpuPacks, slots: SlotDrawer) -> None:
        self._context, self._scheduler = context.graphics, context.scheduler
        self._drawer, self._packs, self._slots = drawer, packs, slots
        self._times: dict[tuple[str, Precision, TexelFilter], PathTimes] = {}

    def times(self, slot: Slot) -> PathTimes | None:
        """Return the times for the slot's pack, precision and filter; None before `chosen` has measured them."""
        return self._times.get((slot.source, slot.precision, slot.filter))

    def chosen(self, slot: Slot, view: ViewState) -> Slot:
        """Return `slot` with a path in place of `auto`, and defaults in fields without effect, so equal pictures have equal slots.

        If it times paths, it changes the scene drawer's last view.
        """
        if is_image_source(slot.source):
            return Slot(slot.source, maps="all" if slot.source == REFERENCE else slot.maps)
        if slot.path != "auto":
            return self._effective(slot)
        times = self.times(slot)
        if times is None:
            times = time_paths(self._slot_ms, view, slot, self._offered(slot))
            self._scheduler.forget()
            if not times.milliseconds:
                # No path can be drawn. Drawing `deferred` raises the error that says why.
                return replace(slot, path="deferred")
            self._times[slot.source, slot.precision, slot.filter] = times
        return self._effective(replace(slot, path=times.fastest))

    def _offered(self, slot: Slot) -> tuple[DecodePath, ...]:
        """Return the paths that `auto` times. `binned` sorts pixels by decoder, which pays only if decoders have weights to share."""
        paths = tuple(path for path in drawable_paths(self._context) if path in EXACT_PATHS)
        return paths if self._packs.shares_decoders(slot.source) else tuple(path for path in paths if path != "binned")

    def known(self, slot: Slot) -> Slot:
        """Return `slot` with a path in place of `auto` if its paths have been timed; never times them."""
        times = self.times(slot) if slot.path == "auto" else None
        return self._effective(slot if times is None else replace(slot, path=times.fastest))

    def _effective(self, slot: Slot) -> Slot:
        """Return `slot` with a path that this driver can run, and filter `exact` for paths that ignore it."""
        if slot.path in COMPUTING and not self._context.features.compute:
            slot = replace(slot, path="forward")
        return replace(slot, filter="exact") if slot.path in FILTERED_PATHS else slot

    def _slot_ms(self, view: ViewState) -> float:
        """Draw slot A of `view`, and return the time in ms."""
        slot, context = self._effective(view.slot_a), self._context
        pack = self._packs.on_gpu(slot)
        anisotropy = view.anisotropy if slot.path in FILTERED_PATHS else 1
        content = SurfaceContent(pack.reading().colors, anisotropy > 1)
        targets, key = PictureTargets(VisibilityTarget(context, view.size, content)), PlaneKey(slot, "base")
        try:
            inputs = self._drawer.draw(view.camera, targets.visibility)
            targets.show(replace(inputs, anisotropy=anisotropy), ShownMaterials())
            timer = self._scheduler.timer
            # With the stochastic filter, a moving camera shows one sample.
            with timer.waiting(), self._scheduler.drawing(whole=slot.filter == "exact"):
                self._slots.draw_plane(key, targets)
            return timer.take_owned()[key]
        finally:
            targets.release()
