"""Noise that shaders choose by: the same bits with every driver, even over its range, and no pattern to see."""

import numpy as np
import pytest

from tests.support import noise
from tests.support.noise import Words, words
from viewer.gl.context import GraphicsContext
from viewer.render.resources.pack_buffers import scene_programs

pytestmark = [pytest.mark.gl, pytest.mark.driver]

WIDTH = 64
HOSTILE = (0, 1, 2, 15, 16, 255, 1920, 4095, 16384, 65535, 65536, 2**24 - 1, 2**24, 2**31 - 1, 2**31, -1, -2, -16384)
SHADER = """#version 430
#include "common/noise.glsl"
layout(binding = 0) uniform usampler2D given;
layout(location = 0) out uvec4 first;
layout(location = 1) out uvec4 second;
void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    uvec4 asked = texelFetch(given, ivec2(place.x, place.y * 2), 0);
    uvec4 other = texelFetch(given, ivec2(place.x, place.y * 2 + 1), 0);
    uint threshold = filter_threshold(asked.xy, asked.z);
    uint blended = blend_threshold(asked.xy, asked.w, asked.z & 15u);
    uint range = 0u;
    first = uvec4(pixel_noise(asked.xy), threshold, blended, uint(is_covered(uintBitsToFloat(other.w), blended)));
    uint taken = 0u;
    for (int choice = 0; choice < 3; ++choice) taken = taken * 2u + uint(second_taken(threshold, range, other[choice]));
    second = uvec4(taken, threshold, range, hash(asked.w));
}
"""


def asked() -> Words:
    """[N, 8] pixel, sample, layer, three shares and the bits of an alpha: random ones, and all pairs of HOSTILE."""
    random = np.random.default_rng(8)
    columns, rows = np.meshgrid(words(HOSTILE), words(HOSTILE))
    table = random.integers(0, 2**32, (4096, 8), np.uint32)
    table[: columns.size, 0], table[: columns.size, 1] = columns.ravel(), rows.ravel()
    # Pictures of some size, and the samples that are drawn.
    table[columns.size : 2048, :2] %= 16384
    table[:2048, 2] %= 16
    table[::7, 4:7] = random.choice(words([0, 1, 2**31, -1]), (len(table[::7]), 3))
    alpha = random.random(len(table)).astype(np.float32)
    alpha[::9] = random.choice(np.array([0.0, 1.0, 0.5, 1e-8, 1.0 - 2.0**-24, 2.0**-24], np.float32), len(alpha[::9]))
    table[:, 7] = alpha.view(np.uint32)
    return table


def drawn(graphics: GraphicsContext, table: Words) -> Words:
    """[N, 8] what the shader makes of `table`."""
    rows = len(table) // WIDTH
    programs = scene_programs(graphics).with_generated({"test.frag": SHADER})
    triangle = programs.fullscreen("test.frag")
    # Two rows of the texture for a row of the picture.
    halves = table.reshape(rows, WIDTH, 2, 4).transpose(0, 2, 1, 3)
    given = graphics.gl.texture((WIDTH, 2 * rows), 4, np.ascontiguousarray(halves).tobytes(), dtype="u4")
    found = [graphics.gl.texture((WIDTH, rows), 4, dtype="u4") for _ in range(2)]
    framebuffer = graphics.gl.framebuffer(found)
    framebuffer.use()
    given.use(0)
    triangle.program["depth"] = 0.0
    triangle.render(vertices=3)
    parts = [np.frombuffer(texture.read(), np.uint32).reshape(-1, 4) for texture in found]
    framebuffer.release()
    for texture in (given, *found):
        texture.release()
    return np.hstack(parts)


def expected(table: Words) -> Words:
    """The same by the twin."""
    x, y, number, layer, *shares, bits = table.T
    threshold = noise.filter_threshold(x, y, number)
    blended = noise.blend_threshold(x, y, layer, number & np.uint32(15))
    covered = noise.is_covered(bits.view(np.float32), blended)
    left, limit, taken = threshold, np.zeros(len(table), np.uint32), np.zeros(len(table), np.uint32)
    for share in shares:
        second, left, limit = noise.second_taken(left, limit, share)
        taken = taken * np.uint32(2) + second
    columns = (noise.pixel_noise(x, y), threshold, blended, covered, taken, left, limit, noise.scrambled(layer))
    return np.stack([column.astype(np.uint32) for column in columns], axis=1)


def test_shaders_have_the_bits_of_the_twin(graphics: GraphicsContext) -> None:
    table = asked()
    np.testing.assert_array_equal(drawn(graphics, table), expected(table))


@pytest.mark.once
def test_samples_of_a_pixel_are_even() -> None:
    x, y = (words(part) for part in np.mgrid[:64, :64])
    numbers = np.arange(16, dtype=np.uint32)[:, None, None]
    layers = noise.scrambled(x)
    blended = np.sort(noise.blend_threshold(x, y, layers, np.broadcast_to(numbers, (16, 64, 64))), axis=0)
    # One in each sixteenth.
    assert (np.diff(blended.astype(np.int64), axis=0) == 1 << 28).all()
    sampled = np.sort(noise.filter_threshold(x, y, numbers).astype(np.int64), axis=0)
    gaps = np.diff(np.vstack([sampled, sampled[:1] + (1 << 32)]), axis=0) / 2.0**32
    # None is as long as two sixteenths.
    assert gaps.max() < 0.1
