"""Tiles of pictures that are too large for a texture or for memory."""

from dataclasses import dataclass

from ntc.errors import InputError
from viewer.render.resources.layout import GROUP_SIDE

MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Tiling:
    """Picture cut into `count` tiles of one size."""

    tile: tuple[int, int]
    """(width, height) in pixels."""
    count: int

    @property
    def pixels(self) -> int:
        """Pixels of all tiles. There are more than in the picture where its sides do not divide."""
        return self.tile[0] * self.tile[1] * self.count


@dataclass(frozen=True)
class PictureLimits:
    """Limits on the buffers of a picture."""

    side: int
    """Largest side of a texture in pixels: GL_MAX_TEXTURE_SIZE."""
    memory_bytes: int


def _tile_side(side: int, parts: int) -> int:
    """Return the side of `parts` tiles that cover `side`, in whole work groups, so that every tile has the same pattern."""
    if parts == 1:
        return side
    return -(-side // (parts * GROUP_SIDE)) * GROUP_SIDE


def tiling(size: tuple[int, int], pixel_bytes: int, limits: PictureLimits) -> Tiling:
    """Return the smallest number of tiles that are within `limits` at `pixel_bytes` per pixel; the longer side is cut first.

    Raises InputError where not even one work group fits.
    """
    parts = [1, 1]
    while True:
        tile = (_tile_side(size[0], parts[0]), _tile_side(size[1], parts[1]))
        if max(tile) <= limits.side and tile[0] * tile[1] * pixel_bytes <= limits.memory_bytes:
            return Tiling(tile, -(-size[0] // tile[0]) * -(-size[1] // tile[1]))
        axis = 0 if tile[0] >= tile[1] else 1
        if tile[axis] <= GROUP_SIDE:
            raise InputError(
                f"--memory-mb {limits.memory_bytes // MEBIBYTE}: not even {tile[0]}x{tile[1]} pixels fit; allow more"
            )
        parts[axis] += 1


def require_memory(option: str, size: tuple[int, int], pixel_bytes: int, limits: PictureLimits) -> None:
    """Check that a picture of `size` fits without tiles. Raises InputError that names `option`."""
    name = f"{option} {size[0]}x{size[1]}"
    if max(size) > limits.side:
        raise InputError(
            f"{name}: this renderer's textures have at most {limits.side} pixels on each side; choose less"
        )
    needed = size[0] * size[1] * pixel_bytes
    if needed > limits.memory_bytes:
        raise InputError(
            f"{name}: takes {needed / MEBIBYTE:,.0f} MiB, more than --memory-mb {limits.memory_bytes // MEBIBYTE}; "
            "choose a smaller picture, or allow more"
        )
