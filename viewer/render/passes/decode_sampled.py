"""Paths that decode every pixel, with the stochastic filter: one sample a frame, accumulated while the view rests."""

from weakref import WeakKeyDictionary

from viewer.render.pass_scheduler import Progress, Step, ToCome
from viewer.render.passes.accumulate import SAMPLES, AccumulatePass
from viewer.render.passes.decode_pass import DecodePass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs


class DecodeSampledPass:
    """Draws the mean of up to SAMPLES samples, each of one texel of every pixel's footprint."""

    def __init__(self, decode: DecodePass, accumulate: AccumulatePass) -> None:
        """`decode` is the pass with the stochastic filter; both belong to this one."""
        self.name = decode.name
        self._decode, self._accumulate = decode, accumulate
        self._samples: WeakKeyDictionary[ColorTarget, int] = WeakKeyDictionary()

    @property
    def bytes_on_gpu(self) -> int:
        """Buffers of the pass, and the last sample."""
        return self._decode.bytes_on_gpu + self._accumulate.bytes_on_gpu

    def advance(self, inputs: VisibilityInputs, target: ColorTarget, step: Step) -> Progress:
        """Draw the next sample, or where the picture is to be whole all that are missing.

        BLEND surfaces are averaged elsewhere: for a further sample of theirs one sample is drawn.
        """
        if inputs.blend_sample:
            self._decode.run(inputs.of_sample(inputs.blend_sample), target)
            return Progress()
        before = self._samples.get(target, 0) if step.is_same_view and not step.is_stale else 0
        for number in range(before, SAMPLES if step.whole else before + 1):
            into = target if number == 0 else self._accumulate.sample(target.size)
            self._decode.run(inputs.of_sample(number), into)
            if number > 0:
                self._accumulate.run(number, target)
            self._samples[target] = number + 1
        left = SAMPLES - self._samples[target]
        return Progress(to_come=(ToCome("samples", left, SAMPLES),) if left else ())

    def release(self) -> None:
        """Free the pass and the last sample."""
        self._decode.release()
        self._accumulate.release()
