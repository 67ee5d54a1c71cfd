"""Places on textures: shaders/ntc/position.glsl against arithmetic that does not round."""

from collections.abc import Sequence
from fractions import Fraction
from math import floor

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.gpu import WRAP_CODES
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.layout import scene_includes

pytestmark = pytest.mark.driver

STEPS = 1 << 32
MODES: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
COORDINATES = (
    *(0.0, -0.0, 0.25, 0.5, 1.0, 2.0, 3.0, -1.0, -2.0, -0.5, 1.5, 0.999999940395, 1.0000001, 1e6 + 0.25, -16777217.0),
    *(1e-45, -1e-45, 1e-38, -1e-10, 1e-10, -1e-7, 3e38, -3e38, np.inf, -np.inf, np.nan),
)
SHADER = """#version 430
layout(local_size_x = 64) in;
#include "ntc/position.glsl"
layout(std430, binding = 0) readonly buffer Given { vec2 given[]; };
layout(std430, binding = 1) writeonly buffer Found { uvec4 found[]; };
uniform int count;
void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= count) return;
    ivec4 asked = floatBitsToInt(vec4(given[number * 2], given[number * 2 + 1]));
    uint coordinate = fixed_coordinate(given[number * 2].x, asked.y);
    Place place = place_along(coordinate, asked.w);
    found[number] = uvec4(coordinate, place.part, place.within, texel_centre(asked.z, asked.w));
}
"""


def run(
    graphics: GraphicsContext, coordinates: Sequence[float], mode: WrapMode, texels: Sequence[int], side: int
) -> NDArray[np.int64]:
    """[N, 4]: fixed coordinate, part and rest along `side`, and the centre of each of `texels`."""
    count = len(coordinates)
    library = ShaderLibrary(shaders_folder(), {**scene_includes(), "test.comp": SHADER})
    program = graphics.gl.compute_shader(library.assemble("test.comp").text)
    given = np.zeros((count, 4), np.int32)
    given[:, 0] = np.asarray(coordinates, np.float32).view(np.int32)
    given[:, 1], given[:, 2], given[:, 3] = WRAP_CODES[mode], texels, side
    asked, found = graphics.gl.buffer(given.tobytes()), graphics.gl.buffer(reserve=16 * count)
    asked.bind_to_storage_buffer(0)
    found.bind_to_storage_buffer(1)
    program["count"] = count
    program.run(-(-count // 64))
    values = np.frombuffer(found.read(), np.uint32).reshape(count, 4).astype(np.int64)
    for each in (asked, found, program):
        each.release()
    return values


def wrapped(coordinate: float, mode: WrapMode) -> Fraction:
    """In [0, 1], exactly."""
    exact = Fraction(coordinate) if np.isfinite(coordinate) else Fraction(0)
    if mode == "clamp":
        return min(max(exact, Fraction(0)), Fraction(1))
    if mode == "repeat":
        return exact - floor(exact)
    folded = exact - 2 * floor(exact / 2)
    return 2 - folded if folded > 1 else folded


def coordinates_to_try() -> list[float]:
    """Hostile and random ones, as fp32."""
    random = np.random.default_rng(5)
    many = [random.uniform(-3.0, 3.0, 200), random.uniform(-1e6, 1e6, 100), random.uniform(-1e-6, 1e-6, 100)]
    with np.errstate(over="ignore"):
        return [float(value) for value in np.concatenate([COORDINATES, *many]).astype(np.float32)]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("side", [1, 3, 1024, 30011, 32768])
def test_places_are_exact_to_a_part_in_4_billion(graphics: GraphicsContext, mode: WrapMode, side: int) -> None:
    coordinates = coordinates_to_try()
    found = run(graphics, coordinates, mode, [0] * len(coordinates), side)
    for coordinate, (fixed, part, within, _) in zip(coordinates, found, strict=True):
        exact = wrapped(coordinate, mode) * STEPS
        # 1 itself is the last step below it.
        assert abs(int(fixed) - exact) <= 1, (coordinate, mode)
        assert int(part) * STEPS + int(within) == int(fixed) * side
        assert part < side


@pytest.mark.parametrize("side", [1, 2, 3, 17, 1000, 4096, 16384, 30011, 32767, 32768])
def test_centres_of_texels_are_exact_to_a_step(graphics: GraphicsContext, side: int) -> None:
    texels = sorted({0, side // 2, side - 1, *np.random.default_rng(side).integers(0, side, 400).tolist()})
    found = run(graphics, [0.0] * len(texels), "clamp", texels, side)
    for texel, centre in zip(texels, found[:, 3], strict=True):
        assert abs(int(centre) - Fraction(2 * texel + 1, 2 * side) * STEPS) <= 1
