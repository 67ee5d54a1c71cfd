"""Geometry of the latent pyramid: how many levels a texture has and where each lies in its flat latent array."""

from dataclasses import dataclass
from typing import Protocol


class PyramidShape(Protocol):
    """Settings of a codec that decide about the pyramid."""

    @property
    def downscale(self) -> int:
        """Texels per cell along one side."""

    @property
    def levels(self) -> int | None:
        """Levels at most; None: no limit."""

    @property
    def smallest_top_cells(self) -> int:
        """The pyramid ends at the first level whose longer side is at most this many cells."""

    @property
    def mips_a_cell(self) -> int:
        """Mips at most that are decoded from the same cells."""


class PyramidTexture(Protocol):
    """Facts about a texture that decide about its pyramid."""

    @property
    def width(self) -> int:
        """Texels along u."""

    @property
    def height(self) -> int:
        """Texels along v."""

    @property
    def code_mips(self) -> int | None:
        """Mips at most that are decoded from the same cells; None: as many as the codec's settings say."""


@dataclass(frozen=True)
class LatentLevel:
    """One level of a texture's latent pyramid. Cells are stored row by row, the row at v = 0 first."""

    width: int
    """Cells along u."""
    height: int
    """Cells along v."""
    texel_width: int
    """Texels along u of the texture mip that this level encodes."""
    texel_height: int
    """Texels along v of the texture mip that this level encodes."""
    first_cell: int
    """Index of the level's first cell in the texture's flat array of cells."""
    mip_of_cell: int = 0
    """Mip within the cells' own: above 0 for a level that is decoded from the cells of the finer level before it."""

    @property
    def cells(self) -> int:
        """Cells of the level."""
        return self.width * self.height

    @property
    def has_own_cells(self) -> bool:
        """Whether the level is stored, and not decoded from the cells of a finer one."""
        return self.mip_of_cell == 0


def texture_levels(texture: PyramidTexture, config: PyramidShape) -> tuple[LatentLevel, ...]:
    """Return the levels of the latent pyramid of `texture`, finest first."""
    return latent_levels(texture.width, texture.height, config, texture.code_mips)


def latent_levels(
    width: int, height: int, config: PyramidShape, code_mips: int | None = None
) -> tuple[LatentLevel, ...]:
    """Return the levels of the latent pyramid of a `width` x `height` texel texture, finest first; never empty.

    Level l encodes texture mip l, of max(1, side >> l) texels, with ceil(side / downscale) cells a side. Where
    a cell holds several mips (`mips_a_cell`), a level whose texels are exactly 2x2 texels of the level before
    has no cells of its own. `code_mips` takes the place of `mips_a_cell` where it is given.
    """
    mips = code_mips or config.mips_a_cell
    levels: list[LatentLevel] = []
    next_cell = 0
    while config.levels is None or len(levels) < config.levels:
        texel_width, texel_height = max(1, width >> len(levels)), max(1, height >> len(levels))
        cells_u, cells_v = -(-texel_width // config.downscale), -(-texel_height // config.downscale)
        before = levels[-1] if levels else None
        if before and before.mip_of_cell + 1 < mips and _halves(before, texel_width, texel_height):
            mip = before.mip_of_cell + 1
            levels.append(LatentLevel(before.width, before.height, texel_width, texel_height, before.first_cell, mip))
        else:
            levels.append(LatentLevel(cells_u, cells_v, texel_width, texel_height, next_cell))
            next_cell += cells_u * cells_v
        if max(cells_u, cells_v) <= config.smallest_top_cells:
            break
    return tuple(levels)


def _halves(finer: LatentLevel, texel_width: int, texel_height: int) -> bool:
    return (finer.texel_width, finer.texel_height) == (2 * texel_width, 2 * texel_height)


def latent_cell_count(width: int, height: int, config: PyramidShape, code_mips: int | None = None) -> int:
    """Return cells of all levels together: the rows of a texture's flat latent array."""
    return sum(level.cells for level in latent_levels(width, height, config, code_mips) if level.has_own_cells)
