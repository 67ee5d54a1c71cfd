"""Mean of several samples of a view with BLEND surfaces (docs/explanation/filtering.md#blend-surfaces)."""

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
    """Inputs of the mean of a slot. The first sample is the slot's picture; its content is read by its version."""

    slot: Slot
    first: ColorTarget
    """Target with the first sample."""
    view: VisibilityInputs
    materials: ShownMaterials


@dataclass(eq=False)
class BlendMean:
    """Mean of the first and further samples. Each draws BLEND surfaces against another pattern of thresholds."""

    size: tuple[int, int]
    samples: int = 1
    target: ColorTarget | None = None
    """Target of the mean; unused while there is one sample."""


SampleDrawer = Callable[[BlendInputs, int], ColorTarget | None]
"""Function that draws the sample of a number; returns None if it stays incomplete."""


class BlendSamplesPass(RenderPass[BlendInputs, BlendMean]):
    """Pass that adds a sample to the mean of a slot with each frame of a view at rest, until there are SAMPLES."""

    name = "blend_samples"
    """Name for the time of all passes that draw further samples."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, draw_sample: SampleDrawer) -> None:
        self._context, self._programs, self._draw_sample = context, programs, draw_sample
        self._accumulator: Accumulator | None = None
        self.given_up: VisibilityInputs | None = None
        """View whose further samples could not be drawn; all its slots show their first sample."""

    def advance(self, inputs: BlendInputs, target: BlendMean, step: Step) -> Progress:
        """Add the next sample, or all missing ones for a whole picture. A moving view shows one sample.

        If memory runs out, all slots show their first sample until the view changes. Raises ShaderError.
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
        """Add a sample to the mean; return False if it stays incomplete. Raises GpuMemoryError, ShaderError."""
        sampled = self._draw_sample(inputs, target.samples)
        if sampled is None:
            return False
        if target.target is None:
            target.target = ColorTarget(self._context, target.size)
        accumulator = self._accumulator = self._accumulator or Accumulator(self._context, self._programs)
        sample = accumulator.sample(target.size)
        if target.samples == 1:
            target.target.copy_from(inputs.first)
        sample.copy_from(sampled)
        accumulator.run(target.samples, target.target)
        target.samples += 1
        return True

    def release(self) -> None:
        """Free the target of the last sample; means belong to their PictureTargets."""
        if self._accumulator is not None:
            self._accumulator.release()
            self._accumulator = None
