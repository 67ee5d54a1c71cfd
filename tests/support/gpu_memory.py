"""GPU memory that refuses some requests, and which objects of OpenGL exist."""

import ctypes

import moderngl

from viewer.gl.allocation import GpuMemory
from viewer.gl.context import GraphicsContext

PLENTY = 1 << 40


HIGHEST_NAME = 4096
"""Drivers give the lowest names that are free."""


class FailingMemory(GpuMemory):
    """Refuses request number `refused` (from 0), and with `for_good` all later ones, until it is made `generous`."""

    def __init__(self, gl: moderngl.Context, refused: int, for_good: bool = False) -> None:
        super().__init__(gl, PLENTY)
        self.asked = 0
        self.generous = False
        self._refused, self._for_good = refused, for_good

    def allows(self, what: str, size: int) -> bool:
        number, self.asked = self.asked, self.asked + 1
        return self.generous or not (number == self._refused or (self._for_good and number > self._refused))


class ForgetfulMemory(GpuMemory):
    """Refuses everything whose name contains `word`."""

    def __init__(self, gl: moderngl.Context, word: str) -> None:
        super().__init__(gl, PLENTY)
        self.word: str | None = word

    def allows(self, what: str, size: int) -> bool:
        return self.word is None or self.word not in what


def existing(context: GraphicsContext) -> dict[str, int]:
    """OpenGL objects by kind, as OpenGL says."""
    counts: dict[str, int] = {}
    for kind in ("Buffer", "Texture", "Framebuffer"):
        is_one = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(context.load(f"glIs{kind}"))
        counts[kind] = sum(bool(is_one(name)) for name in range(1, HIGHEST_NAME))
    return counts
