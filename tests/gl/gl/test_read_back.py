"""Copies of what the GPU has computed: they arrive later, the newest counts, and nothing waits unless it is asked to."""

import time
from typing import Any, Literal

import numpy as np
import pytest

from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import Fence, PicturePart, ReadBack

pytestmark = pytest.mark.driver

DOUBLE = """#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Values { uint values[]; };
uniform uint rounds;
void main() { for (uint i = 0u; i < rounds; ++i) values[gl_GlobalInvocationID.x] += 1u; }
"""


def arrived(back: ReadBack[Any]) -> Any:
    """What arrives within 20 s."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if (found := back.arrived(waits=False)) is not None:
            return found
    raise AssertionError("nothing arrived within 20 s")


def test_a_copy_holds_what_the_shader_had_written_by_then(graphics: GraphicsContext) -> None:
    gl, memory = graphics.gl, graphics.memory
    values, before = memory.buffer("a test", bytes(16)), memory.blocking.count
    program = gl.compute_shader(DOUBLE)
    program["rounds"] = 1000
    back = ReadBack[int](graphics, "a test")
    for number in range(3):
        values.bind_to_storage_buffer(0)
        program.run(4)
        gl.memory_barrier()
        back.copy([(values, 4), (values, 8)], number)
        if number == 0:
            assert back.is_pending
            content, tag = arrived(back)
            assert (content, tag) == ((1000).to_bytes(4, "little") * 3, 0)
            assert not back.is_pending
            assert back.arrived(waits=False) is None
    content, tag = back.arrived(waits=True) or (b"", -1)
    assert (content, tag) == ((3000).to_bytes(4, "little") * 3, 2), "the newest counts"
    assert back.arrived(waits=True) is None
    # It may have been there already.
    assert memory.blocking.count - before <= 1
    back.copy([(values, 4)], 3)
    back.release()
    assert not back.is_pending
    assert back.arrived(waits=False) is None
    values.release()
    program.release()


def test_waiting_is_counted_and_an_arrived_copy_is_not(
    graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    values, memory = graphics.memory.buffer("a test", b"abcd"), graphics.memory
    back, before = ReadBack[None](graphics, "a test"), memory.blocking.count
    back.copy([(values, 4)], None)
    assert arrived(back) == (b"abcd", None)
    assert memory.blocking.count == before
    reached = Fence._wait
    monkeypatch.setattr(Fence, "_wait", lambda fence, nanoseconds: nanoseconds > 0 and reached(fence, nanoseconds))
    back.copy([(values, 4)], None)
    assert back.arrived(waits=False) is None
    monkeypatch.undo()
    monkeypatch.setattr(Fence, "is_reached", property(lambda fence: fence._sync is None))
    assert back.arrived(waits=True) == (b"abcd", None)
    assert memory.blocking.count == before + 1
    back.release()
    values.release()


@pytest.mark.parametrize("kind", ["f2", "f4"])
def test_parts_of_pictures_arrive_as_they_are_read(graphics: GraphicsContext, kind: Literal["f2", "f4"]) -> None:
    width, height = 7, 5
    pixels = np.arange(width * height * 4, dtype=kind).reshape(height, width, 4)
    words = pixels.astype("u4") << 20
    drawn = graphics.memory.texture("a test", (width, height), 4, pixels.tobytes(), dtype=kind)
    found = graphics.memory.texture("a test", (width, height), 4, words.tobytes(), dtype="u4")
    first, second = (graphics.memory.framebuffer("a test", [texture]) for texture in (drawn, found))
    everything = (0, 0, width, height)
    parts = (
        PicturePart(second, (6, 4, 7, 5), "u4"),
        PicturePart(first, (2, 1, 5, 3), kind),
        PicturePart(second, everything, "u4"),
    )
    back = ReadBack[str](graphics, "a test")
    before = graphics.memory.blocking.count
    back.copy_parts(parts, "tag")
    content, tag = arrived(back)
    assert tag == "tag"
    assert graphics.memory.blocking.count == before
    at = 0
    for part, whole in zip(parts, (words, pixels, words), strict=True):
        left, top, right, bottom = part.pixels
        read = part.array(content[at : at + part.byte_count])
        np.testing.assert_array_equal(read, whole[::-1][top:bottom, left:right])
        np.testing.assert_array_equal(read, part.read())
        at += part.byte_count
    assert at == len(content)
    back.release()
    for framebuffer in (first, second):
        framebuffer.release()
    for texture in (drawn, found):
        texture.release()
