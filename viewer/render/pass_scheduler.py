"""Runs the passes of a frame whose inputs have changed, times them, and counts what was skipped."""

from collections import Counter
from typing import Protocol, TypeVar
from weakref import WeakKeyDictionary

from viewer.gl.timer import PassTimer

Inputs_contra = TypeVar("Inputs_contra", contravariant=True)
Output_contra = TypeVar("Output_contra", contravariant=True)
Inputs = TypeVar("Inputs")
Output = TypeVar("Output")


class RenderPass(Protocol[Inputs_contra, Output_contra]):
    """One step of a frame on the GPU. It knows no other pass; its settings are given when it is made.

    Inputs are a frozen dataclass: equal inputs, written to the same output, give the same content. Fields that follow from the others
    do not take part in the comparison.
    """

    name: str
    """Of its time in `FrameResult.timings_ms`."""

    def run(self, inputs: Inputs_contra, output: Output_contra, /) -> None:
        """Write all of `output`."""


class PassScheduler:
    """Remembers what each output was made from, for as long as the output exists."""

    def __init__(self, timer: PassTimer) -> None:
        self.timer = timer
        self.skipped: Counter[str] = Counter()
        """What was skipped since `take_skipped`, and how many of it."""
        self._inputs: WeakKeyDictionary[object, object] = WeakKeyDictionary()

    def run(self, render_pass: RenderPass[Inputs, Output], inputs: Inputs, output: Output) -> bool:
        """Run a pass unless `output` was made from equal inputs; whether it ran."""
        if self._inputs.get(output) == inputs:
            self.skipped["passes"] += 1
            return False
        # Until it is whole it counts as nothing: the pass may raise.
        self.invalidate(output)
        with self.timer.measure(render_pass.name):
            render_pass.run(inputs, output)
        self._inputs[output] = inputs
        return True

    def invalidate(self, output: object) -> None:
        """The content of `output` is not to be relied on: the next `run` runs."""
        self._inputs.pop(output, None)

    def forget(self) -> None:
        """What has run and what was skipped since the last frame is no part of a frame."""
        self.timer.forget()
        self.skipped.clear()

    def take_skipped(self) -> dict[str, int]:
        """What was skipped since the last call."""
        skipped, self.skipped = dict(self.skipped), Counter()
        return skipped
