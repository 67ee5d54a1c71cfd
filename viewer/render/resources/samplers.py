"""OpenGL samplers for glTF samplers."""

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.scene.model import Sampler

_MINIFY = {
    ("none", False): moderngl.NEAREST,
    ("none", True): moderngl.LINEAR,
    ("nearest", False): moderngl.NEAREST_MIPMAP_NEAREST,
    ("nearest", True): moderngl.LINEAR_MIPMAP_NEAREST,
    ("linear", False): moderngl.NEAREST_MIPMAP_LINEAR,
    ("linear", True): moderngl.LINEAR_MIPMAP_LINEAR,
}


class SamplerCache:
    """Cache of OpenGL samplers, by glTF sampler and anisotropy.

    Wrap mode `mirror` becomes clamping, because shaders fold the coordinates before (`wrap_coordinate`).
    """

    def __init__(self, context: GraphicsContext) -> None:
        self._gl = context.gl
        self._most = context.features.anisotropy
        self._samplers: dict[tuple[Sampler, int], moderngl.Sampler] = {}

    def get(self, sampler: Sampler, anisotropy: int = 1) -> moderngl.Sampler:
        """Return the OpenGL sampler. `anisotropy`: 1 (none) to 16, limited by the driver."""
        anisotropy = min(anisotropy, self._most)
        key = (sampler, anisotropy)
        if key not in self._samplers:
            self._samplers[key] = self._gl.sampler(
                repeat_x=sampler.wrap[0] == "repeat",
                repeat_y=sampler.wrap[1] == "repeat",
                filter=(
                    _MINIFY[(sampler.mipmap, sampler.minify_linear)],
                    moderngl.LINEAR if sampler.magnify_linear else moderngl.NEAREST,
                ),
                anisotropy=float(anisotropy),
            )
        return self._samplers[key]

    def release(self) -> None:
        """Free all samplers."""
        for sampler in self._samplers.values():
            sampler.release()
        self._samplers.clear()
