"""Mean of several samples of a plane or a picture, for the stochastic filter and BLEND surfaces."""

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GL_ONE_MINUS_SRC1_COLOR, GL_SRC1_COLOR
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import TextureUnit

PIXEL_BYTES = 16
SAMPLES = 16
"""Number of samples that complete a picture at rest with the stochastic filter, or with BLEND surfaces."""


class Accumulator:
    """Accumulator of samples: adds one sample to a mean, in place."""

    name = "accumulate"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._context = context
        self._triangle = programs.fullscreen("passes/accumulate/accumulate.frag")
        self._sample: ColorTarget | None = None

    def sample(self, size: tuple[int, int]) -> ColorTarget:
        """Return the target for the next sample of a picture of this size. Raises GpuMemoryError."""
        if self._sample is None or self._sample.size != size:
            self.release()
            self._sample = ColorTarget(self._context, size)
        return self._sample

    def run(self, samples_before: int, mean: ColorTarget) -> None:
        """Add the sample to `mean`, which is that of `samples_before` samples, in fp32."""
        gl = self._context.gl
        mean.framebuffer.use()
        self.sample(mean.size).texture.use(int(TextureUnit.PICTURE_A))
        gl.enable_only(moderngl.BLEND)
        gl.blend_func = GL_SRC1_COLOR, GL_ONE_MINUS_SRC1_COLOR
        set_uniforms(self._triangle.program, {"weight": 1.0 / (samples_before + 1), "depth": 0.0})
        try:
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            gl.enable_only(moderngl.NOTHING)
            gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the sample."""
        return PIXEL_BYTES * self._sample.size[0] * self._sample.size[1] if self._sample is not None else 0

    def release(self) -> None:
        """Free the sample."""
        if self._sample is not None:
            self._sample.release()
            self._sample = None
