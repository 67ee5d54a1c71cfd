"""Looking at the pixels of a picture through a magnifying glass; the camera stays where it is."""

from dataclasses import dataclass, replace

LARGEST = 64.0
STEP = 1.25
"""Change of the magnification from one notch of the wheel."""


@dataclass(frozen=True)
class Zoom:
    """Which part of the picture is shown."""

    factor: float = 1.0
    """Shown pixels along a side of a pixel of the picture, 1 to 64."""
    centre: tuple[float, float] = (0.5, 0.5)
    """What is in the middle, as shares of the picture from its upper left corner."""

    @property
    def is_whole(self) -> bool:
        """Whether the whole picture is shown as it is."""
        return self.factor <= 1.0

    @property
    def corner(self) -> tuple[float, float]:
        """Upper left corner of what is shown, as shares of the picture; what is shown never leaves the picture."""
        half = 0.5 / self.factor
        x, y = (min(max(value, half), 1.0 - half) - half for value in self.centre)
        return x, y

    def window_to_image(self, x: float, y: float) -> tuple[float, float]:
        """What of the picture is shown at (x, y); both as shares from the upper left corner."""
        left, top = self.corner
        return left + x / self.factor, top + y / self.factor

    def image_to_window(self, x: float, y: float) -> tuple[float, float]:
        """Where (x, y) of the picture is shown: the inverse of `window_to_image`."""
        left, top = self.corner
        return (x - left) * self.factor, (y - top) * self.factor

    def moved(self, dx: float, dy: float) -> "Zoom":
        """The picture dragged by (dx, dy), as shares of what is shown."""
        left, top = self.corner
        half = 0.5 / self.factor
        return replace(self, centre=(left + half - dx / self.factor, top + half - dy / self.factor))

    def towards(self, x: float, y: float, notches: float) -> "Zoom":
        """Larger by `notches` of the wheel (smaller if negative), with what is shown at (x, y) staying there."""
        factor = min(max(self.factor * STEP**notches, 1.0), LARGEST)
        at = self.window_to_image(x, y)
        half = 0.5 / factor
        return Zoom(factor, (at[0] - x / factor + half, at[1] - y / factor + half))


WHOLE = Zoom()
"""The whole picture as it is."""
