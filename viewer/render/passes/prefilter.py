"""Prefilters an environment for the shading pass."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.metrics.block_cache import SUFFIX, BlockCache
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.lighting.prefilter import MOST_SAMPLES, PrefilterSize, irradiance_map, lobe_samples, source_samples
from viewer.render.resources.layout import TextureUnit, UniformBinding
from viewer.render.resources.light.environment_maps import EnvironmentMaps

VERSION = 2
"""Of prefiltered environments in the cache: changes with what the shaders write."""


@dataclass(frozen=True)
class PrefilterInputs:
    """Equal keys stand for equal panoramas."""

    key: str
    panorama: NDArray[np.float32] = field(compare=False)
    """[H, 2 H, 3] linear radiance."""
    is_kept: bool = field(default=False, compare=False)
    """Whether the result is kept on disk, and found there: for files, whose key is the digest of their content."""


class PrefilterPass:
    """Inputs: a panorama. Output: EnvironmentMaps of the panorama's size, written whole."""

    name = "prefilter"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, cache: BlockCache | None = None) -> None:
        """`cache`: where prefiltered files are kept; None: nowhere."""
        self._context, self._cache = context, cache
        self._mean = programs.fullscreen("passes/prefilter/source.frag")
        self._convolution = programs.fullscreen("passes/prefilter/convolve.frag")
        self._source: moderngl.Texture | None = None
        self._samples: moderngl.Buffer | None = None

    def run(self, inputs: PrefilterInputs, output: EnvironmentMaps) -> None:
        """Write the panorama and all maps. Raises GpuMemoryError."""
        output.write_panorama(inputs.panorama)
        cache = self._cache if inputs.is_kept else None
        width, height = output.size.texture_size
        path = None if cache is None else cache.folder / f"{self._digest(inputs.key, output.size)}{SUFFIX}"
        if cache is not None and path is not None:
            found = cache.read(path, width * height * 16)
            if found is not None:
                output.maps.write(found)
                return
        self._draw(output)
        self._write_irradiance(inputs.panorama, output)
        if cache is not None and path is not None:
            cache.write(path, output.maps.read())
            cache.trim()

    @staticmethod
    def _digest(key: str, size: PrefilterSize) -> str:
        return hashlib.sha256(f"{VERSION} {key} {size}".encode()).hexdigest()[:32]

    def _source_of(self, side: int) -> moderngl.Texture:
        if self._source is None or self._source.width != side:
            if self._source is not None:
                self._source.release()
            what = f"an octahedral map of {side} x {side}"
            self._source = self._context.memory.texture(what, (side, side), 4, dtype="f4")
            self._source.repeat_x = self._source.repeat_y = False
        return self._source

    @staticmethod
    def _write_irradiance(panorama: NDArray[np.float32], output: EnvironmentMaps) -> None:
        side = output.size.irradiance_side
        pixels = np.ones((side + 2, 6, side + 2, 4), np.float32)
        pixels[..., :3] = irradiance_map(panorama, side)
        output.maps.write(pixels.tobytes(), viewport=(0, output.size.tops[-1], 6 * (side + 2), side + 2))

    def _draw(self, output: EnvironmentMaps) -> None:
        size = output.size
        source = self._source_of(size.source_side)
        output.panorama.use(int(TextureUnit.PANORAMA))
        steps = source_samples(output.panorama_width, size.source_side)
        self._fill(self._mean, source, {"steps": steps, "side": size.source_side})
        self._context.memory.build_mipmaps("an octahedral map", source)
        source.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        source.use(int(TextureUnit.ENVIRONMENT))
        if self._samples is None:
            self._samples = self._context.memory.buffer("directions of a lobe", reserve=MOST_SAMPLES * 16, dynamic=True)
        self._samples.bind_to_uniform_block(int(UniformBinding.SAMPLES))
        for level, (side, top) in enumerate(zip(size.sides, size.tops[:-1], strict=True)):
            lobe = lobe_samples(level / (len(size.sides) - 1), size.samples, size.source_side)
            self._samples.write(lobe.astype("<f4").tobytes())
            part = (0, top, 6 * (side + 2), side + 2)
            self._fill(self._convolution, output.maps, {"top": top, "side": side, "samples": len(lobe)}, part)

    def _fill(
        self,
        triangle: moderngl.VertexArray,
        texture: moderngl.Texture,
        values: Mapping[str, object],
        part: tuple[int, int, int, int] | None = None,
    ) -> None:
        """Draw every texel of a texture, or of a part of it (left, top, width, height)."""
        framebuffer = self._context.memory.framebuffer("an environment", [texture])
        try:
            framebuffer.viewport = part or (0, 0, *texture.size)
            framebuffer.use()
            self._context.gl.enable_only(moderngl.NOTHING)
            set_uniforms(triangle.program, {**values, "depth": 0.0})
            triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            framebuffer.release()

    def release(self) -> None:
        """Free what is used in between."""
        for part in (self._source, self._samples):
            if part is not None:
                part.release()
        self._source = self._samples = None
