"""Prefilter pass: convolves an environment for each roughness (shaders/passes/prefilter, docs/explanation/lighting.md#light)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.content_cache import ContentCache
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.jobs.job import Job, JobReport
from viewer.lighting.prefilter import MOST_SAMPLES, irradiance_map, lobe_samples, source_samples
from viewer.render.pass_scheduler import Pending, Progress, RenderPass, Step
from viewer.render.resources.layout import TextureUnit, UniformBinding
from viewer.render.resources.light import EnvironmentMaps

VERSION = 2
"""Version of cached environments. Increase it when the shaders write something else."""


@dataclass(frozen=True)
class PrefilterInputs:
    """Inputs of the prefilter. Equal keys mean equal panoramas."""

    key: str
    panorama: NDArray[np.float32] = field(compare=False)
    """[H, 2 H, 3] linear radiance."""
    is_cached: bool = field(default=False, compare=False)
    """True if the disk cache stores the result: for panoramas, whose key is the digest of their content."""


@dataclass(eq=False)
class _Filtering:
    """Progress of filtering one environment."""

    key: str
    irradiance: Job[NDArray[np.float32]]
    """Irradiance map [side + 2, 6, side + 2, 4] float32; takes seconds, in a thread."""
    level: int = 0
    """Number of the next map to write."""


class PrefilterPass(RenderPass[PrefilterInputs, EnvironmentMaps]):
    """Pass that prefilters an environment. Inputs: a panorama. Output: EnvironmentMaps of the panorama's size.

    If frames do not wait, a panorama takes one frame for each map. The sky is small and follows the sun, so it is filtered at once.
    """

    name = "prefilter"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, cache: ContentCache | None = None) -> None:
        """Take the disk cache of prefiltered panoramas; None: no cache."""
        self._context, self._cache = context, cache or ContentCache(None)
        self._mean = programs.fullscreen("passes/prefilter/source.frag")
        self._convolution = programs.fullscreen("passes/prefilter/convolve.frag")
        self._source: moderngl.Texture | None = None
        self._samples: moderngl.Buffer | None = None
        self._filtering: _Filtering | None = None

    def advance(self, inputs: PrefilterInputs, output: EnvironmentMaps, step: Step) -> Progress:
        """Write the panorama, and all maps or the next one. Raises GpuMemoryError."""
        whole = step.budget.waits or not inputs.is_cached
        width, height = output.size.texture_size
        key = f"{VERSION} {inputs.key} {output.size}"
        if not step.is_same_view or self._filtering is None or self._filtering.key != inputs.key:
            output.write_panorama(inputs.panorama)
            maps = self._cache.read(key) if inputs.is_cached else None
            if maps is not None and len(maps) == width * height * 16:
                output.maps.write(maps)
                return Progress()
            self._draw_source(output)
            irradiance = Job(partial(_irradiance, inputs.panorama, output.size.irradiance_side))
            self._filtering = _Filtering(inputs.key, irradiance.start("irradiance"))
        filtering, levels = self._filtering, len(output.size.sides)
        for level in range(filtering.level, levels if whole else min(filtering.level + 1, levels)):
            self._draw_level(level, output)
            filtering.level = level + 1
        if filtering.level < levels or not (whole or filtering.irradiance.done):
            return Progress(pending=(Pending("environment", levels + 1 - filtering.level, levels + 1),))
        self._filtering = None
        side = output.size.irradiance_side
        pixels = filtering.irradiance.future.result().tobytes()
        output.maps.write(pixels, viewport=(0, output.size.tops[-1], 6 * (side + 2), side + 2))
        if inputs.is_cached:
            self._cache.write(key, output.maps.read())
        return Progress()

    def _source_of(self, side: int) -> moderngl.Texture:
        if self._source is None or self._source.width != side:
            if self._source is not None:
                self._source.release()
            what = f"an octahedral map of {side} x {side}"
            self._source = self._context.memory.texture(what, (side, side), 4, dtype="f4")
            self._source.repeat_x = self._source.repeat_y = False
        return self._source

    def _draw_source(self, output: EnvironmentMaps) -> None:
        """Write the octahedral map with its mips, from which all others are filtered."""
        size = output.size
        source = self._source_of(size.source_side)
        output.panorama.use(int(TextureUnit.PANORAMA))
        steps = source_samples(output.panorama_width, size.source_side)
        self._fill(self._mean, source, {"steps": steps, "side": size.source_side})
        self._context.memory.build_mipmaps("an octahedral map", source)
        source.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def _draw_level(self, level: int, output: EnvironmentMaps) -> None:
        """Write the map of one roughness."""
        size = output.size
        self._source_of(size.source_side).use(int(TextureUnit.ENVIRONMENT))
        if self._samples is None:
            self._samples = self._context.memory.buffer("directions of a lobe", reserve=MOST_SAMPLES * 16, dynamic=True)
        self._samples.bind_to_uniform_block(int(UniformBinding.SAMPLES))
        side, top = size.sides[level], size.tops[level]
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
        """Free the intermediate textures and buffers."""
        for part in (self._source, self._samples):
            if part is not None:
                part.release()
        self._source = self._samples = None


def _irradiance(panorama: NDArray[np.float32], side: int, _report: JobReport) -> NDArray[np.float32]:
    pixels = np.ones((side + 2, 6, side + 2, 4), np.float32)
    pixels[..., :3] = irradiance_map(panorama, side)
    return pixels
