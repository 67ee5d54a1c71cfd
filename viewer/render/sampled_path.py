"""Paths that decode every pixel, with the stochastic filter: one sample a frame, accumulated while the view rests."""

from collections.abc import Callable, Collection

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.timer import PassTimer
from viewer.render.passes.accumulate import AccumulatePass
from viewer.render.passes.decode_pass import DecodePass
from viewer.render.passes.needed_levels import VisibleLatents
from viewer.render.plane_path import SAMPLES
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs


class SampledPath:
    """Draws the mean of up to SAMPLES samples, each of one texel of every pixel's footprint."""

    memory_part = "tables"
    tiles = None
    is_partial = False

    def __init__(
        self,
        name: str,
        make_pass: Callable[[], DecodePass],
        latents: VisibleLatents,
        timer: PassTimer,
        context: GraphicsContext,
        programs: ProgramFactory,
    ) -> None:
        """`make_pass` makes the pass with the stochastic filter, when it is first used."""
        self._name, self._make_pass, self._latents, self._timer = name, make_pass, latents, timer
        self._drawn_with = 0
        """Version of the latents in the samples so far."""
        self._context, self._programs = context, programs
        self._pass: DecodePass | None = None
        self._accumulate: AccumulatePass | None = None
        self._drawn: tuple[VisibilityInputs, ColorTarget] | None = None
        """What `samples` are of, and where their mean is."""
        self.samples = 0
        """Samples of the last picture so far."""

    @property
    def bytes_on_gpu(self) -> int:
        """Buffers of the pass, and the last sample."""
        return sum(part.bytes_on_gpu for part in (self._pass, self._accumulate) if part is not None)

    @property
    def is_waiting(self) -> bool:
        """Whether the picture lacks samples, or has some of coarser latents than it needs."""
        is_coarse = self._latents.is_waiting or self._drawn_with != self._latents.version
        return self.samples > 0 and (self.samples < SAMPLES or is_coarse)

    def decode_ahead(self, inputs: VisibilityInputs) -> bool:
        """Wait for finer latents where no samples are missing."""
        self._latents.poll(inputs)
        return self.samples >= SAMPLES and self._drawn_with == self._latents.version

    def draw(self, inputs: VisibilityInputs, target: ColorTarget, whole: bool, same_view: bool = False) -> None:
        """Draw the next sample, or with `whole` all that are missing."""
        del same_view
        if inputs.blend_sample:
            self._draw_with_blend(inputs, target, whole)
            return
        before = self.samples if self._drawn == (inputs, target) else 0
        # Until it is drawn the picture counts for nothing.
        self._drawn, self.samples = None, 0
        self._latents.upload(inputs, whole)
        if self._drawn_with != self._latents.version:
            # Samples of coarser latents are of no use.
            self._drawn_with, before = self._latents.version, 0
        decode, accumulate = self._passes()
        for number in range(before, SAMPLES if whole else before + 1):
            into = target if number == 0 else accumulate.sample(target.size)
            with self._timer.measure(f"decode_{self._name}"):
                decode.run(inputs.of_sample(number), into)
                if number > 0:
                    accumulate.run(number, target)
            before = number + 1
        self._drawn, self.samples = (inputs, target), before

    def _draw_with_blend(self, inputs: VisibilityInputs, target: ColorTarget, whole: bool) -> None:
        """Draw one sample for a further sample of BLEND surfaces, which are averaged elsewhere.

        The picture of the first one, and how far it has come, stay as they are.
        """
        self._latents.upload(inputs, whole)
        decode, _ = self._passes()
        with self._timer.measure(f"decode_{self._name}"):
            decode.run(inputs.of_sample(inputs.blend_sample), target)

    def _passes(self) -> tuple[DecodePass, AccumulatePass]:
        # Made outside of the measured time: compiling is no part of a frame.
        self._pass = self._pass or self._make_pass()
        self._accumulate = self._accumulate or AccumulatePass(self._context, self._programs)
        return self._pass, self._accumulate

    def update(self, textures: Collection[int], regrouped: bool) -> None:
        """Begin the picture anew, with a new pass where it depends on which decoders there are."""
        del textures
        self._drawn, self.samples = None, 0
        if regrouped:
            self.release()

    def release(self) -> None:
        """Free the pass and the last sample."""
        for part in (self._pass, self._accumulate):
            if part is not None:
                part.release()
        self._pass = self._accumulate = None
        self._drawn, self.samples = None, 0
