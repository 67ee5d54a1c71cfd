"""A rectangle of the window: where the picture is, and what is drawn over it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Area:
    """A rectangle in window units."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Along x."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Along y."""
        return self.bottom - self.top

    def share_of(self, x: float, y: float) -> tuple[float, float]:
        """A place of the window as shares of this rectangle, from its upper left corner."""
        return (x - self.left) / self.width, (y - self.top) / self.height

    def at(self, x: float, y: float) -> tuple[float, float]:
        """The place of the window that is (x, y) as shares of this rectangle."""
        return self.left + x * self.width, self.top + y * self.height

    def pixels(self, window: tuple[float, float], framebuffer: tuple[int, int]) -> tuple[int, int]:
        """(width, height) in pixels, at least 1.

        The window is `window` (width, height) large in its own units, and `framebuffer` in pixels.
        """
        width, height = (
            max(1, round(side * pixels / max(units, 1.0)))
            for side, units, pixels in zip((self.width, self.height), window, framebuffer, strict=True)
        )
        return width, height
