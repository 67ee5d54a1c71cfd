"""The window's content as pixels, and over time as an animated WebP."""

import io
import math
from dataclasses import dataclass, field
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.io import write_bytes

SECONDS_BETWEEN_PICTURES = 0.1
"""Shortest time in seconds between two pictures of a film."""
LAST_PICTURE_SECONDS = 1.5
"""Time in seconds that the last picture stays before a player begins anew."""
LARGEST_FILM = 512 << 20
"""Limit in bytes of all pictures in memory, at which every second one is dropped."""
QUALITY = 60
"""Quality of the pictures, 0 to 100, as libwebp counts it."""


def read_pixels(framebuffer: moderngl.Framebuffer) -> NDArray[np.uint8]:
    """Read a framebuffer: [H, W, 3] uint8, row 0 on top."""
    # The window's own framebuffer goes on saying the size that it was opened with: its viewport is what is shown.
    viewport = framebuffer.viewport
    width, height = viewport[2:]
    pixels = np.frombuffer(framebuffer.read(viewport=viewport, components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])


@dataclass
class Film:
    """Film so far; each of its pictures is shown until the next one was taken."""

    path: Path
    _pictures: list[NDArray[np.uint8]] = field(default_factory=list)
    _times: list[float] = field(default_factory=list)
    """Monotonic seconds at which each picture was taken."""

    def wants(self, now: float) -> bool:
        """Return whether a picture at `now` (monotonic seconds) would be taken."""
        return now - (self._times[-1] if self._times else -math.inf) >= SECONDS_BETWEEN_PICTURES

    def add(self, pixels: NDArray[np.uint8], now: float) -> None:
        """Take a picture [H, W, 3] uint8 sRGB, row 0 on top.

        One that equals the last, or has another size than the first, is left out.
        """
        if self._pictures and (pixels.shape != self._pictures[0].shape or np.array_equal(pixels, self._pictures[-1])):
            return
        if sum(picture.nbytes for picture in self._pictures) + pixels.nbytes > LARGEST_FILM:
            del self._pictures[1::2], self._times[1::2]
        self._pictures.append(pixels)
        self._times.append(now)

    def write(self) -> int:
        """Write the file, and return how many pictures it has; nothing is written without one. Raises InputError."""
        if not self._pictures:
            return 0
        ends = [*self._times[1:], self._times[-1] + LAST_PICTURE_SECONDS]
        durations = [round(1000.0 * (end - begin)) for begin, end in zip(self._times, ends, strict=True)]
        first, *others = (Image.fromarray(picture) for picture in self._pictures)
        coded = io.BytesIO()
        first.save(
            coded,
            "WEBP",
            save_all=True,
            append_images=others,
            duration=durations,
            loop=0,
            quality=QUALITY,
            method=4,
            allow_mixed=True,
        )
        write_bytes(self.path, coded.getvalue())
        return len(self._pictures)
