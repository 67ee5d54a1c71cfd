"""Capture of the window's content as pixels, and as an animated WebP."""

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
"""Time in seconds for which the last picture is shown before a player repeats the film."""
LARGEST_FILM = 512 << 20
"""Limit in bytes of all pictures in memory. Beyond it every second picture is dropped."""
QUALITY = 60
"""Quality of the pictures on libwebp's scale from 0 to 100."""


def read_pixels(framebuffer: moderngl.Framebuffer) -> NDArray[np.uint8]:
    """Read the pixels [H, W, 3] uint8 of a framebuffer, row 0 on top."""
    # moderngl reports the size with which the window's framebuffer was opened. Its viewport has the present size.
    viewport = framebuffer.viewport
    width, height = viewport[2:]
    pixels = np.frombuffer(framebuffer.read(viewport=viewport, components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])


@dataclass
class Film:
    """Film that is being recorded. Each picture is shown until the next one was taken."""

    path: Path
    _pictures: list[NDArray[np.uint8]] = field(default_factory=list)
    _times: list[float] = field(default_factory=list)
    """Monotonic seconds at which each picture was taken."""

    def wants(self, now: float) -> bool:
        """Return whether the next picture is due at `now` (monotonic seconds)."""
        return now - (self._times[-1] if self._times else -math.inf) >= SECONDS_BETWEEN_PICTURES

    def add(self, pixels: NDArray[np.uint8], now: float) -> None:
        """Add a picture [H, W, 3] uint8 sRGB, row 0 on top.

        A picture that equals the last one, or has another size than the first one, is left out.
        """
        if self._pictures and (pixels.shape != self._pictures[0].shape or np.array_equal(pixels, self._pictures[-1])):
            return
        if sum(picture.nbytes for picture in self._pictures) + pixels.nbytes > LARGEST_FILM:
            del self._pictures[1::2], self._times[1::2]
        self._pictures.append(pixels)
        self._times.append(now)

    def write(self) -> int:
        """Write the file and return its number of pictures. Without pictures no file is written. Raises InputError."""
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
