"""Numbering of tiles of decoded texels, and the pages of the tile atlas that hold them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import WRAP_CODES
from ntc.codec.latents import texture_levels
from ntc.codec.maps import Plane
from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.render.resources.layout import PAGES_ACROSS, TILE_RECORD, TILE_SIDE
from viewer.scene.model import Material

TILE_ROW = np.dtype(
    [
        *((name, "<i4") for name in ("first_entry", "across", "texture", "level")),
        ("wrap", "<i4", (2,)),
        ("single", "?"),
        ("first", "<i4"),
    ]
)
"""Record of the tiles of a mip with one pair of WRAP_ codes: the fields of TILE_LEVEL_RECORD, texture id, mip number, whether
the mip is a single tile, and the row of the finest mip of the same texture and modes."""


@dataclass(frozen=True, eq=False)
class TileTable:
    """Numbering of all tiles: a tile's entry is its number, counted mip after mip.

    A tile's border depends on the wrap modes, so each pair of wrap modes has separate tiles.
    """

    first_level_of_material: NDArray[np.int32]
    """[materials] row of the texture's finest mip; -1 if nothing is decoded."""
    rows: NDArray[np.void]
    """[rows] TILE_ROW of each mip."""
    entries: int
    """Number of tiles of all mips."""

    @staticmethod
    def of(materials: tuple[Material, ...], pack: Pack, match: PackMatch, plane: Plane = "base") -> "TileTable":
        """Make the table of the textures that `pack` decodes in a plane of their maps."""
        first_of: dict[tuple[int, int, int], int] = {}
        firsts: list[int] = []
        rows: list[tuple[object, ...]] = []
        entries = 0
        for material in materials:
            plane_texture = material.plane(plane)
            index = match.texture_index[plane_texture.texture_id] if plane_texture is not None else -1
            if plane_texture is None or index < 0:
                firsts.append(-1)
                continue
            wrap = (int(WRAP_CODES[plane_texture.sampler.wrap[0]]), int(WRAP_CODES[plane_texture.sampler.wrap[1]]))
            key = (plane_texture.texture_id, *wrap)
            if key not in first_of:
                first_of[key] = len(rows)
                texture = pack.textures[index]
                for number, level in enumerate(texture_levels(texture, pack.config)):
                    across, down = (-(-side // TILE_SIDE) for side in (level.texel_width, level.texel_height))
                    rows.append(
                        (entries, across, plane_texture.texture_id, number, wrap, across * down == 1, first_of[key])
                    )
                    entries += across * down
            firsts.append(first_of[key])
        table = np.array(rows or [(0, 1, -1, 0, (0, 0), True, 0)], TILE_ROW)
        return TileTable(np.array(firsts or [-1], np.int32), table, max(1, entries))

    def are_single(self, entries: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return [N] whether these entries are the only tile of their mip. Such tiles are shown first."""
        single: NDArray[np.bool_] = self.rows["single"][self._rows(entries)]
        return single

    def stand_ins(self, firsts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the entries of the fallback tiles of textures, given by first rows [N].

        They are the finest mip of a single tile, and the coarsest mip. A tile can only replace finer ones.
        """
        ends = np.append(np.nonzero(self.rows["level"] == 0)[0], len(self.rows))
        last = ends[np.searchsorted(ends, firsts, side="right")] - 1
        singles = np.nonzero(self.rows["single"])[0]
        next_singles = (
            singles[np.minimum(np.searchsorted(singles, firsts), max(len(singles) - 1, 0))] if len(singles) else last
        )
        rows = np.unique([np.where((next_singles >= firsts) & (next_singles <= last), next_singles, last), last])
        entries: NDArray[np.int64] = self.rows["first_entry"][rows].astype(np.int64)
        return entries

    def textures(self, entries: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the first rows of the textures of these entries [N]."""
        firsts: NDArray[np.int64] = self.rows["first"][self._rows(entries)].astype(np.int64)
        return firsts

    def _rows(self, entries: NDArray[np.int64]) -> NDArray[np.int64]:
        rows: NDArray[np.int64] = np.searchsorted(self.rows["first_entry"], entries, side="right") - 1
        return rows

    def tiles(self, entries: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the records of these entries, with page 0: [N] TILE_RECORD."""
        rows = self._rows(entries)
        place = entries - self.rows["first_entry"][rows]
        tiles = np.zeros(len(entries), TILE_RECORD)
        tiles["texture_id"], tiles["level"] = self.rows["texture"][rows], self.rows["level"][rows]
        tiles["tile_x"], tiles["tile_y"] = place % self.rows["across"][rows], place // self.rows["across"][rows]
        tiles["wrap_u"], tiles["wrap_v"] = self.rows["wrap"][rows].T
        tiles["entry"] = entries
        return tiles


def finest_levels(tiles: NDArray[np.void]) -> dict[int, int]:
    """Return the finest mip of TILE_RECORDs, by texture id."""
    order = np.lexsort((tiles["level"], tiles["texture_id"]))
    textures, first = np.unique(tiles["texture_id"][order], return_index=True)
    return dict(zip(textures.tolist(), tiles["level"][order][first].tolist(), strict=True))


FREE = -1
LAYER_PAGES = PAGES_ACROSS * PAGES_ACROSS
"""Number of pages on a layer of the tile atlas."""


class PagePool:
    """Pages of the tile atlas, given to tiles: free pages first, then the least recently read (LRU eviction)."""

    def __init__(self, pages: int) -> None:
        if pages < 1:
            raise ValueError(f"{pages} pages: there must be at least one")
        self._entry_of_page = np.full(pages, FREE, np.int64)
        self._placed_in = np.zeros(pages, np.int64)
        self._fresh = 0
        self._free: list[int] = []

    @property
    def pages(self) -> int:
        """Number of pages, taken or not."""
        return len(self._entry_of_page)

    def reach(self, count: int) -> int:
        """Return the number of pages to allocate for placing `count` more tiles: all up to the last one ever used."""
        return min(self.pages, self._fresh + max(0, count - len(self._free)))

    def shrink(self, pages: int) -> None:
        """Limit the pool to `pages` pages, but keep all pages that were ever used."""
        self._entry_of_page = self._entry_of_page[: max(pages, self._fresh, 1)]
        self._placed_in = self._placed_in[: len(self._entry_of_page)]

    @property
    def taken(self) -> int:
        """Number of pages that hold a tile."""
        return self._fresh - len(self._free)

    def place(
        self, entries: NDArray[np.int64], frame: int, last_read: Callable[[], NDArray[np.uint32]]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return (pages for the first of `entries`, entries evicted for them).

        There are fewer pages than entries if all other pages were read in `frame`. `last_read` returns the last frame that read each
        page [pages]; it is called only if tiles must be evicted.
        """
        pages = [self._free.pop() for _ in range(min(len(self._free), len(entries)))]
        fresh = min(self.pages - self._fresh, len(entries) - len(pages))
        pages += range(self._fresh, self._fresh + fresh)
        self._fresh += fresh
        gone = np.zeros(0, np.int64)
        if len(pages) < len(entries):
            # Tiles placed in this frame were not read yet, and must stay.
            read = np.maximum(last_read()[: self.pages].astype(np.int64), self._placed_in)
            read[pages] = frame
            old = np.nonzero((self._entry_of_page != FREE) & (read < frame))[0]
            old = old[np.argsort(read[old], kind="stable")][: len(entries) - len(pages)]
            gone = self._entry_of_page[old]
            pages += old.tolist()
        placed = np.array(pages, np.int64)
        self._entry_of_page[placed] = entries[: len(placed)]
        self._placed_in[placed] = frame
        return placed, gone

    def drop(self, entries: NDArray[np.int64]) -> None:
        """Free the pages of these tiles."""
        pages = np.nonzero(np.isin(self._entry_of_page, entries))[0]
        self._entry_of_page[pages] = FREE
        self._free += pages.tolist()

    def pages_of(self, entries: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the pages of `entries`. All must have one."""
        order = np.argsort(self._entry_of_page, kind="stable")
        return order[np.searchsorted(self._entry_of_page[order], entries)]

    def needed_in(self, pages: NDArray[np.int64], frame: int, last_read: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Return which of `pages` were read or placed in `frame`. `last_read` [pages]: last frame that read each page."""
        return np.asarray((last_read[pages] == frame) | (self._placed_in[pages] == frame), np.bool_)

    def held(self) -> NDArray[np.int64]:
        """Return the entries of the tiles that have a page."""
        held: NDArray[np.int64] = self._entry_of_page[self._entry_of_page != FREE]
        return held
