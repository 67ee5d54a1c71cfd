"""How a plane of a slot's maps comes onto the screen: the interface of all decode paths, and those that decode every pixel at once."""

from collections.abc import Callable, Collection
from typing import Protocol

from viewer.gl.timer import PassTimer
from viewer.render.passes.decode_pass import DecodePass
from viewer.render.passes.needed_levels import VisibleLatents
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.render.tile_cache.budget import TileCounts

OUT_OF_DATE = -1
"""No version of latents."""
SAMPLES = 16
"""Of a picture at rest with the stochastic filter; then nothing is drawn any more."""


class PlanePath(Protocol):
    """Draws one plane of a pack, in one frame or over several."""

    memory_part: str
    """What `bytes_on_gpu` counts as in reports."""

    @property
    def bytes_on_gpu(self) -> int:
        """Buffers and textures of the path; the pack's own are not among them."""

    @property
    def tiles(self) -> TileCounts | None:
        """The state of the path's tile cache; None where it has none."""

    @property
    def samples(self) -> int:
        """Samples in the last picture; 0 where the filter is exact."""

    @property
    def is_waiting(self) -> bool:
        """Whether drawing the same view again improves it."""

    @property
    def is_partial(self) -> bool:
        """Whether the last `draw` left rows of the picture for the next ones."""

    def decode_ahead(self, inputs: VisibilityInputs) -> bool:
        """Work for the next picture of the same view without drawing; False when it is time to draw."""

    def draw(self, inputs: VisibilityInputs, target: ColorTarget, whole: bool, same_view: bool = False) -> None:
        """Draw the plane. With `whole` nothing is left for later frames.

        With `same_view`, where `target` shows an older picture of this view, the path may draw some of its rows only.
        """

    def update(self, textures: Collection[int], regrouped: bool) -> None:
        """The pack's buffers hold another version of these scene textures; `regrouped`: some have another decoder than before."""

    def release(self) -> None:
        """Free what belongs to the path alone."""


class DirectPath:
    """Decodes every visible pixel in every picture. The pass is made when it is first used."""

    memory_part = "tables"
    tiles = None
    samples = 0
    is_partial = False

    def __init__(
        self,
        name: str,
        make_pass: Callable[[], DecodePass],
        latents: VisibleLatents,
        timer: PassTimer,
    ) -> None:
        self._name, self._make_pass, self._latents, self._timer = name, make_pass, latents, timer
        self._pass: DecodePass | None = None
        self._drawn_with = 0
        """Version of the latents in the last picture."""

    @property
    def bytes_on_gpu(self) -> int:
        """Buffers of the pass."""
        return self._pass.bytes_on_gpu if self._pass is not None else 0

    @property
    def is_waiting(self) -> bool:
        """Whether finer latents are on their way, or have come since the picture was drawn."""
        return self._latents.is_waiting or self._drawn_with != self._latents.version

    def decode_ahead(self, inputs: VisibilityInputs) -> bool:
        """Wait for finer latents."""
        self._latents.poll(inputs)
        return self._drawn_with == self._latents.version

    def draw(self, inputs: VisibilityInputs, target: ColorTarget, whole: bool, same_view: bool = False) -> None:
        """Upload the latents that are missing, and decode the picture."""
        del same_view
        self._latents.upload(inputs, whole)
        self._drawn_with = self._latents.version
        if self._pass is None:
            # Made outside of the measured time: compiling is no part of a frame.
            self._pass = self._make_pass()
        with self._timer.measure(f"decode_{self._name}"):
            self._pass.run(inputs, target)

    def update(self, textures: Collection[int], regrouped: bool) -> None:
        """Draw anew, with a new pass where it depends on what has changed: which decoders there are."""
        del textures
        self._drawn_with = OUT_OF_DATE
        if regrouped:
            self.release()

    def release(self) -> None:
        """Free the pass."""
        if self._pass is not None:
            self._pass.release()
            self._pass = None
