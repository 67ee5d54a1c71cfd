"""Which page of the tile atlas holds which tile: free pages first, then the ones that have not been read for longest."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.render.resources.layout import PAGES_ACROSS

FREE = -1
LAYER_PAGES = PAGES_ACROSS * PAGES_ACROSS
"""Pages on a layer of the atlas."""


class PagePool:
    """`pages` pages, at least one. Entries are numbers of tiles."""

    def __init__(self, pages: int) -> None:
        if pages < 1:
            raise ValueError(f"{pages} pages: there must be at least one")
        self._entry_of_page = np.full(pages, FREE, np.int64)
        self._placed_in = np.zeros(pages, np.int64)
        self._fresh = 0
        self._free: list[int] = []

    @property
    def pages(self) -> int:
        """All pages, taken or not."""
        return len(self._entry_of_page)

    def reach(self, count: int) -> int:
        """Number of pages that must exist to place `count` more tiles: all up to the last one ever used."""
        return min(self.pages, self._fresh + max(0, count - len(self._free)))

    def shrink(self, pages: int) -> None:
        """Limit the pool to `pages` pages, where there is no memory for more. Pages that were ever used stay."""
        self._entry_of_page = self._entry_of_page[: max(pages, self._fresh, 1)]
        self._placed_in = self._placed_in[: len(self._entry_of_page)]

    @property
    def taken(self) -> int:
        """Pages that hold a tile."""
        return self._fresh - len(self._free)

    def place(
        self, entries: NDArray[np.int64], frame: int, last_read: Callable[[], NDArray[np.uint32]]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pages for the first of `entries`, and the entries that had to go for them.

        There are fewer pages than entries where all others were read in `frame`. `last_read` gives the last frame that read each
        page [pages]; it is asked only if tiles must go.
        """
        pages = [self._free.pop() for _ in range(min(len(self._free), len(entries)))]
        fresh = min(self.pages - self._fresh, len(entries) - len(pages))
        pages += range(self._fresh, self._fresh + fresh)
        self._fresh += fresh
        gone = np.zeros(0, np.int64)
        if len(pages) < len(entries):
            # What was placed in this frame has not been read yet.
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
        """The pages that hold `entries`, which all must have one."""
        order = np.argsort(self._entry_of_page, kind="stable")
        return order[np.searchsorted(self._entry_of_page[order], entries)]

    def needed_in(self, pages: NDArray[np.int64], frame: int, last_read: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Which of `pages` were read in `frame`, or placed in it and so not read yet. `last_read` as for `place`."""
        return np.asarray((last_read[pages] == frame) | (self._placed_in[pages] == frame), np.bool_)

    def held(self) -> NDArray[np.int64]:
        """Entries of the tiles that have a page."""
        held: NDArray[np.int64] = self._entry_of_page[self._entry_of_page != FREE]
        return held
