"""The mean of several samples of a plane or a picture, as the stochastic filter and BLEND surfaces give them."""

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import GROUP_SIDE, ImageUnit

PIXEL_BYTES = 16


class AccumulatePass:
    """Inputs: the mean of the samples so far, and one more sample. Output: their mean, in place of the one before."""

    name = "accumulate"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._context = context
        self._program = programs.compute("passes/accumulate/accumulate.comp")
        self._sample: ColorTarget | None = None

    def sample(self, size: tuple[int, int]) -> ColorTarget:
        """What the next sample of a picture of this size is drawn into. Raises GpuMemoryError."""
        if self._sample is None or self._sample.size != size:
            self.release()
            self._sample = ColorTarget(self._context, size)
        return self._sample

    def run(self, samples_before: int, mean: ColorTarget) -> None:
        """Add the sample to `mean`, that of `samples_before` samples, in fp32."""
        mean.texture.bind_to_image(int(ImageUnit.TARGET), read=True, write=True)
        self.sample(mean.size).texture.bind_to_image(int(ImageUnit.SAMPLE), read=True, write=False)
        set_uniforms(self._program, {"samples_before": samples_before})
        self._program.run(*(-(-side // GROUP_SIDE) for side in mean.size))
        self._context.gl.memory_barrier()

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the sample."""
        return PIXEL_BYTES * self._sample.size[0] * self._sample.size[1] if self._sample is not None else 0

    def release(self) -> None:
        """Free the sample."""
        if self._sample is not None:
            self._sample.release()
            self._sample = None
