"""Samples of views with BLEND surfaces: the mean of several is shown."""

from collections.abc import Callable
from dataclasses import dataclass

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.pass_scheduler import Pending, Progress, RenderPass, Step
from viewer.render.resources.accumulator import SAMPLES, Accumulator
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import ShownMaterials, VisibilityInputs
from viewer.state.view_state import Slot


@dataclass(frozen=True)
class BlendInputs:
    """Inputs of the samples of a slot. The slot's own picture, which is the first of them, is read by its version."""

    slot: Slot
    own: ColorTarget
    """Target of the slot's own picture."""
    view: VisibilityInputs
    materials: ShownMaterials


@dataclass(eq=False)
class BlendMean:
    """Mean of a slot's own picture and further ones, for which BLEND surfaces are drawn against other patterns of thresholds."""

    size: tuple[int, int]
    samples: int = 1
    target: ColorTarget | None = None
    """Target of the mean; without meaning while there is one sample."""


SampleDrawer = Callable[[BlendInputs, int], ColorTarget | None]
"""Function that draws a further sample, by its number; None where it cannot be drawn whole."""


class BlendSamplesPass(RenderPass[BlendInputs, BlendMean]):
    """Pass that adds a sample to the mean of a slot with each frame of a view at rest, until there are SAMPLES."""

    name = "blend_samples"
    """Name of the time of all passes of further samples."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, draw_sample: SampleDrawer) -> None:
        self._context, self._programs, self._draw_sample = context, programs, draw_sample
        self._accumulator: Accumulator | None = None
        self.given_up: VisibilityInputs | None = None
        """View whose samples could not be drawn: all its slots stay with their first sample."""

    def advance(self, inputs: BlendInputs, target: BlendMean, step: Step) -> Progress:
        """Add the next sample, or where the picture is to be whole all that are missing. A view that moves is shown one sample.

        Where memory is short, all slots stay with their first sample while the view is the same. Raises ShaderError.
        """
        is_new = not step.is_same_view or step.is_stale
        if is_new:
            target.samples = 1
        end = SAMPLES if step.budget.is_whole else target.samples if is_new else target.samples + 1
        try:
            is_drawn = all(self._add(inputs, target) for _ in range(target.samples, end))
        except GpuMemoryError:
            is_drawn = False
        if not is_drawn:
            self.given_up, target.samples = inputs.view, 1
            return Progress()
        left = SAMPLES - target.samples
        return Progress(pending=(Pending("samples", left, SAMPLES),) if left else ())

    def _add(self, inputs: BlendInputs, target: BlendMean) -> bool:
        """Add a sample to the mean; return False where it cannot be drawn whole. Raises GpuMemoryError, ShaderError."""
        sampled = self._draw_sample(inputs, target.samples)
        if sampled is None:
            return False
        if target.target is None:
            target.target = ColorTarget(self._context, target.size)
        accumulator = self._accumulator = self._accumulator or Accumulator(self._context, self._programs)
        sample = accumulator.sample(target.size)
        if target.samples == 1:
            target.target.copy_from(inputs.own)
        sample.copy_from(sampled)
        accumulator.run(target.samples, target.target)
        target.samples += 1
        return True

    def release(self) -> None:
        """Free the last sample; means belong to their targets."""
        if self._accumulator is not None:
            self._accumulator.release()
            self._accumulator = None
