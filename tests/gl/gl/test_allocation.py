"""Requests for GPU memory that the driver or a limit refuses."""

from dataclasses import replace

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gpu_memory import ForgetfulMemory, existing
from viewer.gl.allocation import LIMIT_VARIABLE, GpuMemory, GpuMemoryError, limit_from_environment
from viewer.gl.context import GraphicsContext
from viewer.gl.ui_textures import NamedImages, Thumbnails


def test_the_driver_itself_is_asked(graphics: GraphicsContext) -> None:
    before = existing(graphics)
    with pytest.raises(GpuMemoryError, match=r"^vertices: the GPU has no memory for 1125899907 MB; close packs"):
        graphics.memory.buffer("vertices", reserve=1 << 50)
    assert existing(graphics) == before
    assert graphics.memory.buffer("vertices", b"abcd").read() == b"abcd"


def test_a_buffer_that_cannot_grow_stays(graphics: GraphicsContext) -> None:
    memory = GpuMemory(graphics.gl, 100)
    small = memory.buffer("pixels", b"12345678")
    with pytest.raises(GpuMemoryError, match="pixels: the GPU has no memory for"):
        memory.grown("pixels", small, 101)
    assert small.read() == b"12345678"
    grown = memory.grown("pixels", small, 60)
    assert (grown.size, memory.bytes_given, memory.objects_given) == (60, 60, 1)
    grown.release()


def test_the_interface_shows_grey_without_memory(graphics: GraphicsContext) -> None:
    memory = ForgetfulMemory(graphics.gl, "thumbnail")
    context = replace(graphics, memory=memory)
    thumbnails = Thumbnails(context, lambda _: np.zeros((8, 8, 3), np.uint8))
    assert thumbnails[3].size == (1, 1)
    assert (thumbnails.take_problem() or "").startswith("thumbnail 3: the GPU has no memory for ")
    assert thumbnails.take_problem() is None
    thumbnails.release()
    images = NamedImages(context)
    memory.word = "image"
    for _ in range(2):
        assert images.get("flat", np.zeros((4, 4, 3), np.uint8)).size == (1, 1)
    assert (images.take_problem() or "").startswith("image 'flat': ")
    images.release()
    assert memory.objects_given == 0


@pytest.mark.parametrize("text", ["x", "-1", "1.5"])
def test_a_limit_that_is_none(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, text)
    with pytest.raises(InputError, match=f"{LIMIT_VARIABLE}=.*must be a whole number of MB"):
        limit_from_environment()


def test_the_limit_is_in_megabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "3")
    assert limit_from_environment() == 3_000_000
    monkeypatch.delenv(LIMIT_VARIABLE)
    assert limit_from_environment() is None
