"""Compression to BC7, BC5 and BC4 on the GPU: blocks against their float64 twin, the hardware, other encoders, and other drivers."""

import hashlib
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.mips import srgb_to_linear
from tests.support.block_texels import block_texels
from viewer.gl.context import GraphicsContext
from viewer.gl.texture_arrays import STORED_COMPONENTS, BlockArray, GpuBlockFormat
from viewer.render.resources.block_compressor import BlockCompressor, ImageCompressor, total_errors
from viewer.render.resources.layout import TextureUnit
from viewer.render.resources.pack_buffers import scene_programs

pytestmark = [pytest.mark.gl, pytest.mark.computes]
FORMATS: tuple[GpuBlockFormat, ...] = ("bc7", "bc5", "bc4")
Pixels = NDArray[np.uint8]
DIGESTS = {"bc7": "073c30690c03d883", "bc5": "615077ca4043757d", "bc4": "134ab5e9eca888bd"}
"""Of the blocks of `hostile` and `soft`. Record them again where the search changes."""


def hostile(opaque: bool) -> Pixels:
    """[30, 61, 4] texels: noise, extremes, one value, two values, ramps, and blocks over the edge."""
    random = np.random.default_rng(7)
    pixels = np.zeros((30, 61, 4), np.uint8)
    pixels[:8] = random.integers(0, 256, (8, 61, 4))
    pixels[8:12] = 255 * random.integers(0, 2, (4, 61, 4))
    pixels[12:16] = np.repeat(random.integers(0, 256, (1, 16, 4)), 4, axis=1)[:, :61]
    pixels[16:20] = np.where(random.random((4, 61, 1)) < 0.5, (10, 200, 30, 255), (250, 3, 128, 40))
    ramp = np.arange(61)
    pixels[20:26] = np.stack([ramp * 4, 255 - ramp, 100 + ramp // 8, 255 - ramp // 2], axis=1)
    pixels[26:] = 120 + random.integers(0, 4, (4, 61, 4))
    if opaque:
        pixels[..., 3] = 255
    return pixels


def soft(side: int = 64) -> Pixels:
    """[side, side, 4] opaque texels as textures have them: smooth, with some edges and noise."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[:side, :side] / side
    waves = [np.sin(9.0 * x + k) * np.cos(7.0 * y - k) for k in range(3)]
    image = (
        128.0
        + 60.0 * np.stack(waves, axis=2)
        + 40.0 * (x + y > 1.0)[..., None]
        + random.normal(0.0, 3.0, (side, side, 3))
    )
    return np.dstack([np.clip(image, 0, 255), np.full((side, side), 255)]).astype(np.uint8)


@pytest.fixture(scope="module")
def compressor(graphics: GraphicsContext) -> ImageCompressor:
    return ImageCompressor(graphics, scene_programs(graphics))


@pytest.mark.driver
@pytest.mark.parametrize("block_format", FORMATS)
def test_every_driver_finds_the_same_blocks(compressor: ImageCompressor, block_format: GpuBlockFormat) -> None:
    found = b"".join(compressor.blocks(pixels, block_format) for pixels in (hostile(True), hostile(False), soft()))
    assert hashlib.sha256(found).hexdigest()[:16] == DIGESTS[block_format]


@pytest.mark.parametrize("opaque", [True, False])
@pytest.mark.parametrize("block_format", FORMATS)
def test_the_error_is_that_of_the_float64_twin(
    graphics: GraphicsContext, compressor: ImageCompressor, block_format: GpuBlockFormat, opaque: bool
) -> None:
    pixels = hostile(opaque)
    pixels = np.pad(pixels, ((0, 2), (0, 3), (0, 0)), mode="edge")
    height, width = pixels.shape[:2]
    components = 3 if opaque and block_format == "bc7" else STORED_COMPONENTS[block_format]
    twin = block_texels(compressor.blocks(pixels, block_format), (width, height), block_format)
    expected = ((twin[..., :components] - pixels[..., :components]) ** 2).sum()
    gl = graphics.gl
    errors, blocks = gl.buffer(bytes(8)), gl.buffer(reserve=width * height)
    texels = gl.texture_array((width, height, 1), 4, pixels.tobytes())
    texels.use(int(TextureUnit.ATLAS))
    BlockCompressor(graphics, scene_programs(graphics), block_format, False).run((width, height), blocks, errors)
    told = total_errors(np.frombuffer(errors.read(), np.uint32).reshape(1, 2))[0]
    # Errors of BC4 are rounded for each block.
    assert told == pytest.approx(expected, abs=0.5 * width * height / 16)
    assert np.abs(twin[..., 3] - 255.0).max() <= 1.0 if opaque and block_format == "bc7" else True
    for made in (errors, blocks, texels):
        made.release()


_READ = """#version 430
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 3) uniform sampler2DArray images;
layout(std430, binding = 0) writeonly buffer Texels { vec4 texels[]; };
uniform ivec2 size;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(at, size))) texels[at.y * size.x + at.x] = texelFetch(images, ivec3(at, 1), 0);
}
"""


@pytest.fixture(scope="module")
def reader(graphics: GraphicsContext) -> Iterator[moderngl.ComputeShader]:
    made = graphics.gl.compute_shader(_READ)
    yield made
    made.release()


@pytest.mark.driver
@pytest.mark.parametrize("block_format", FORMATS)
def test_the_hardware_reads_what_the_twin_reads(
    graphics: GraphicsContext, compressor: ImageCompressor, reader: moderngl.ComputeShader, block_format: GpuBlockFormat
) -> None:
    pixels = hostile(False)
    height, width = pixels.shape[:2]
    data = compressor.blocks(pixels, block_format)
    twin = block_texels(data, (width, height), block_format) / 255.0
    stored = STORED_COMPONENTS[block_format]
    srgb = block_format == "bc7"
    components = range(4 - stored, 4)
    array = BlockArray(graphics, (width, height), 2, 1, block_format, srgb, components)
    blocks = graphics.gl.buffer(bytes(16) + data)
    array.write(1, 0, 0, (width, height), blocks, 16)
    array.use(3)
    texels = graphics.gl.buffer(reserve=16 * width * height)
    texels.bind_to_storage_buffer(0)
    reader["size"] = (width, height)
    reader.run(8, 4)
    found = np.frombuffer(texels.read(), np.float32).reshape(height, width, 4)
    if srgb:
        twin[..., :3] = srgb_to_linear(twin[..., :3])
    # Mesa cuts off both parts of a value between the ends of BC4 and BC5.
    np.testing.assert_allclose(found[..., components.start :], twin, atol=(0.1 if srgb else 1.5) / 255.0)
    assert not found[..., : components.start].any()
    for made in (array, blocks, texels):
        made.release()
