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


def picture(side: int = 512, left: int = 0, top: int = 0) -> Words:
    """[side, side] noise of a part of a picture."""
    rows, columns = np.mgrid[top : top + side, left : left + side]
    return noise.pixel_noise(words(columns), words(rows))


@pytest.mark.once
@pytest.mark.parametrize("corner", [(0, 0), (1408, 568), (15872, 15872)])
def test_noise_is_that_of_its_source(corner: tuple[int, int]) -> None:
    rows, columns = np.mgrid[corner[1] : corner[1] + 512, corner[0] : corner[0] + 512]
    formula = (52.9829189 * ((0.06711056 * columns + 0.00583715 * rows) % 1.0)) % 1.0
    off = np.abs(picture(512, *corner) / 2.0**32 - formula)
    # At whole numbers the one is just below 1 and the other is just above 0.
    assert np.minimum(off, 1.0 - off).max() < 4e-4


def chi_squared(values: Words, bins: int = 256) -> float:
    """Pearson's statistic over its mean for independent values: 1 where they are random, 0 where they are exactly even."""
    counts, _ = np.histogram(values / 2.0**32, bins, (0.0, 1.0))
    even = values.size / bins
    return float(((counts - even) ** 2 / even).sum() / (bins - 1))


@pytest.mark.once
@pytest.mark.parametrize("corner", [(0, 0), (1408, 568), (15872, 15872)])
@pytest.mark.parametrize("number", [0, 1, 15])
def test_thresholds_are_at_least_as_even_as_random_ones(corner: tuple[int, int], number: int) -> None:
    rows, columns = np.mgrid[corner[1] : corner[1] + 512, corner[0] : corner[0] + 512]
    x, y = words(columns), words(rows)
    # 1.3 is beyond what one of 1000 random pictures has.
    assert chi_squared(noise.filter_threshold(x, y, np.full_like(x, number))) < 1.3
    assert chi_squared(noise.blend_threshold(x, y, words(7), np.full_like(x, number))) < 1.3


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


@pytest.mark.once
def test_neighbours_share_the_range_and_no_line_is_alike() -> None:
    values = picture() / 2.0**32
    windows = np.lib.stride_tricks.sliding_window_view(values, (3, 3)).reshape(-1, 9)
    # Means of nine random values deviate by 0.096.
    assert windows.mean(1).std() < 0.048
    rows, columns = values.mean(1), values.mean(0)
    # Means of 512 random values deviate by 0.0128.
    assert max(rows.std(), columns.std()) < 0.0128
