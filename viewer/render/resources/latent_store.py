"""Latents on the GPU: upload of the mips that visible pixels need, within a budget, and replacement by newer versions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import LATENT_COLUMN_BITS, LEVEL_RECORD, GpuTables, StoredRows, level_records
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.model import EncodedTexture
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext


@dataclass(frozen=True)
class LatentBudget:
    """Limit of GPU memory for latents."""

    budget_bytes: int = 1 << 30


@dataclass(frozen=True)
class LatentCounts:
    """Numbers of uploaded and missing latents."""

    bytes_uploaded: int
    bytes_left_out: int
    """Number of bytes of mips that no view has needed so far."""
    textures_left_out: int
    """Number of textures of which no view has needed any mip so far."""
    levels_without_room: int
    """Number of visible mips that do not fit into the budget; coarser ones are shown."""
    out_of_memory: bool = False
    """True if the GPU has less memory than the budget, or a shader can read fewer bytes than needed."""


class LatentStore:
    """Latents of a table of textures (None: not encoded). With a mip, all coarser mips are on the GPU.

    Sizes are counted in cells, the rows of stored latents (`GpuTables.row_words`).
    """

    def __init__(
        self,
        context: GraphicsContext,
        tables: GpuTables,
        textures: Sequence[EncodedTexture | None],
        budget: LatentBudget,
    ) -> None:
        self.gl, self.memory = context.gl, context.memory
        self.tables, self._textures = tables, list(textures)
        self.cell_bytes = 4 * tables.row_words
        """Number of bytes of one cell on the GPU."""
        # All latents lie in one buffer, whose size the driver limits.
        limits = context.memory.limits
        self._most_bytes, self._limit_name = limits.storage_block_bytes, limits.storage_limit
        self._is_limited = self._most_bytes < budget.budget_bytes
        self._budget_cells = max(1, min(budget.budget_bytes, self._most_bytes) // self.cell_bytes)
        self.pyramids: tuple[tuple[LatentLevel, ...], ...] = tuple(
            () if texture is None else texture_levels(texture, tables.settings) for texture in textures
        )
        self.rows: list[tuple[StoredRows, ...]] = [self._rows_of(texture) for texture in textures]
        """Rows of each mip in its texture's latents, by texture."""
        counts = [len(pyramid) for pyramid in self.pyramids]
        self.first_level = np.concatenate([[0], np.cumsum(counts)])[: len(counts)].astype(np.int32)
        """[textures] index of each texture's finest mip in `levels`."""
        self.levels = np.zeros(max(1, sum(counts)), LEVEL_RECORD)
        """[mips] LEVEL_RECORD; `first_cell` is valid for mips on the GPU."""
        for first, pyramid in zip(self.first_level, self.pyramids, strict=True):
            self.levels[first : first + len(pyramid)] = level_records(pyramid)
        self.finest = np.array(counts, np.int32)
        """[textures] finest mip on the GPU; the number of mips if there is none."""
        # Each texture has one entry more than mips, for `finest` without any mip.
        self._first_sum = self.first_level + np.arange(len(counts))
        self._cells_from = self._counted_cells()
        self._mips = np.array(counts, np.int64)
        self._used = 0
        self._without_room = 0
        self._out_of_memory = False
        self.buffer: moderngl.Buffer = context.memory.buffer("latents", reserve=self.cell_bytes)
        self.written: tuple[int, int] | None = None
        """Range (first, end) of bytes that have changed since LatentImage set this to None; None: no change."""

    def _rows_of(self, texture: EncodedTexture | None) -> tuple[StoredRows, ...]:
        return () if texture is None else self.tables.level_rows(texture)

    def _counted_cells(self) -> NDArray[np.int64]:
        """Return the number of cells from each mip on: int64, for each texture its mips and one entry 0."""
        return np.array(
            [sum(row.rows for row in rows[start:]) for rows in self.rows for start in range(len(rows) + 1)], np.int64
        )

    def _cells(self, index: int, finest: int) -> int:
        """Return the number of cells of a texture's mips from `finest` on."""
        return int(self._cells_from[self._first_sum[index] + finest])

    @property
    def bytes_by_texture(self) -> NDArray[np.int64]:
        """[textures] int64 number of uploaded bytes of each texture."""
        cells: NDArray[np.int64] = self._cells_from[self._first_sum + self.finest]
        return cells * self.cell_bytes

    @property
    def counts(self) -> LatentCounts:
        """Current numbers of latents."""
        total = int(self._cells_from[self._first_sum].sum()) * self.cell_bytes
        there = int(self.bytes_by_texture.sum())
        absent = int(np.count_nonzero((self.finest >= self._mips) & (self._mips > 0)))
        short = self._out_of_memory or (self._is_limited and self._without_room > 0)
        return LatentCounts(there, total - there, absent, self._without_room, short)

    @property
    def refusal(self) -> str:
        """Message with the reason why latents are missing, and the remedy."""
        if self._out_of_memory:
            return "latents: the GPU has no memory for all of them; close other programs"
        total = int(self._cells_from[self._first_sum].sum()) * self.cell_bytes
        return (
            f"latents: {total / 1e6:.0f} MB exceed the {self._most_bytes / 1e6:.0f} MB that shaders can read of one buffer "
            f"({self._limit_name}); use a pack with fewer or smaller textures"
        )

    def all_levels(self) -> dict[int, int]:
        """Return all mips of all textures, as an argument of `ensure_resident`."""
        return {index: 0 for index, pyramid in enumerate(self.pyramids) if pyramid}

    def has(self, wanted: Mapping[int, int]) -> bool:
        """Return whether these mips, given as finest mip by texture, are on the GPU."""
        return all(self.finest[index] <= level for index, level in wanted.items())

    def replace_textures(self, textures: Mapping[int, EncodedTexture]) -> None:
        """Use these versions, given by index, for later uploads. Latents on the GPU stay (`LatentUpdate` replaces those)."""
        for index, texture in textures.items():
            self._textures[index] = texture

    def fits(self, index: int, texture: EncodedTexture) -> bool:
        """Return whether each mip of this version has the size of the current one, so it can replace it in place."""
        return self._rows_of(texture) == self.rows[index]

    def reload(self, textures: Mapping[int, EncodedTexture]) -> int:
        """Take these versions, given by index, of any size, and upload all resident mips again. Return the number of bytes.

        Raises GpuMemoryError as `ensure_resident` does.
        """
        there = {index: int(level) for index, level in enumerate(self.finest) if level < self._mips[index]}
        self.replace_textures(textures)
        for index, texture in textures.items():
            self.rows[index] = self._rows_of(texture)
        self._cells_from = self._counted_cells()
        self.finest[:], self._used = self._mips, 0
        self.ensure_resident(there)
        return int(self.bytes_by_texture.sum())

    def ensure_resident(self, wanted: Mapping[int, int]) -> bool:
        """Upload the missing ones of these mips (finest mip by texture) and of all coarser ones; return whether anything changed.

        If the budget is full, all other latents are dropped. If that is not enough, the finest mips of the largest textures are left
        out. If the GPU has less memory than the budget, the budget shrinks to what it has. Raises GpuMemoryError if not even the
        coarsest mips fit; then none are on the GPU.
        """
        missing = {index: level for index, level in wanted.items() if self.finest[index] > level}
        if not missing:
            return False
        cells = sum(
            self._cells(index, level) - self._cells(index, int(self.finest[index])) for index, level in missing.items()
        )
        self._without_room = 0
        if self._used + cells > self._budget_cells:
            missing, cells = self._restart(wanted)
        try:
            self._reserve(self._used + cells)
        except GpuMemoryError:
            self._out_of_memory = True
            self._budget_cells = max(1, self.buffer.size // self.cell_bytes)
            missing, cells = self._restart(wanted)
            self._reserve(cells)
        start = self._used * self.cell_bytes
        self.memory.write(self.buffer, b"".join(self._place(index, level) for index, level in missing.items()), start)
        self.note_written(start, self._used * self.cell_bytes)
        return True

    def _restart(self, wanted: Mapping[int, int]) -> tuple[dict[int, int], int]:
        """Drop all latents; return the part of `wanted` that fits into the budget, and its number of cells."""
        self.finest[:] = self._mips
        self._used = 0
        fitting = self._fitting(wanted)
        return fitting, sum(self._cells(index, level) for index, level in fitting.items())

    def _fitting(self, wanted: Mapping[int, int]) -> dict[int, int]:
        """Return the part of `wanted` that the budget holds, with at least the coarsest mip of each texture."""
        fitting = dict(wanted)
        cells = sum(self._cells(index, level) for index, level in fitting.items())
        saved = {index: self._saved(index, level) for index, level in fitting.items()}
        while cells > self._budget_cells:
            largest = max(saved, key=saved.__getitem__)
            if not saved[largest]:
                break
            coarser = self._smaller(largest, fitting[largest])
            cells -= saved[largest]
            self._without_room += coarser - fitting[largest]
            fitting[largest] = coarser
            saved[largest] = self._saved(largest, coarser)
        return fitting

    def _saved(self, index: int, level: int) -> int:
        """Return the number of cells that dropping a texture's finest mip saves, or its finest mips if they share cells."""
        return self._cells(index, level) - self._cells(index, self._smaller(index, level))

    def _smaller(self, index: int, level: int) -> int:
        """Return the next coarser mip with fewer cells, or `level` if there is none. Mips that share a code share cells."""
        cells = self._cells(index, level)
        return next(
            (each for each in range(level, len(self.pyramids[index])) if self._cells(index, each) < cells), level
        )

    def _reserve(self, cells: int) -> None:
        size = cells * self.cell_bytes
        if size <= self.buffer.size:
            return
        roomy = max(size, min(2 * self.buffer.size, self._budget_cells * self.cell_bytes))
        try:
            grown = self.memory.buffer("latents", reserve=roomy)
        except GpuMemoryError:
            if roomy == size:
                raise
            grown = self.memory.buffer("latents", reserve=size)
        if self._used:
            self.gl.copy_buffer(grown, self.buffer, self._used * self.cell_bytes)
        self.buffer.release()
        self.buffer = grown

    def _place(self, index: int, finest: int) -> bytes:
        """Place a texture's missing mips from `finest` on behind the used cells; return the bytes to upload there."""
        texture, rows = self._textures[index], self.rows[index]
        assert texture is not None
        present = int(self.finest[index])
        start = rows[finest].first
        end = rows[present].first if present < len(rows) else rows[-1].first + rows[-1].rows
        for number in reversed(range(finest, present)):
            row = int(self.first_level[index]) + number
            # A mip without rows is decoded from those of the next coarser mip, which may be on the GPU already.
            shared = rows[number].rows == 0 and number + 1 < len(rows)
            coarser = int(self.levels[row + 1]["first_cell"]) if shared else 0
            self.levels[row]["first_cell"] = coarser if shared else self._used + rows[number].first - start
        self._used += end - start
        self.finest[index] = finest
        return self.tables.latent_words(texture, slice(start, end)).tobytes()

    def note_written(self, start: int, end: int) -> None:
        """Add a range of changed bytes to `written`."""
        first, last = self.written or (start, end)
        self.written = min(first, start), max(last, end)

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


class LatentImage:
    """Copy of a store's buffer in an image of 2^LATENT_COLUMN_BITS columns, which software renderers read several times faster."""

    def __init__(self, store: LatentStore) -> None:
        self._store = store
        self._texture: moderngl.Texture | None = None

    def update(self) -> moderngl.Texture:
        """Copy the changed bytes of the store; return the image. Raises GpuMemoryError."""
        columns = 1 << LATENT_COLUMN_BITS
        buffer, row_bytes = self._store.buffer, 4 * columns
        rows = -(-buffer.size // row_bytes)
        if self._texture is None or self._texture.height < rows:
            self.release()
            self._texture = self._store.memory.texture("image of latents", (columns, rows), 1, dtype="u4")
            self._store.note_written(0, buffer.size)
        if self._store.written is not None:
            written = self._store.written
            first, end = written[0] // row_bytes, -(-written[1] // row_bytes)
            start = first * row_bytes
            # Whole rows are copied on the GPU, through a staging buffer. Reading the store's buffer would wait for the GPU.
            staged = self._store.memory.buffer("image of latents", reserve=(end - first) * row_bytes)
            self._store.gl.copy_buffer(staged, buffer, min(end * row_bytes, buffer.size) - start, read_offset=start)
            self._texture.write(staged, (0, first, columns, end - first))
            staged.release()
            self._store.written = None
        return self._texture

    @property
    def size(self) -> int:
        """Number of bytes of the image."""
        return 0 if self._texture is None else 4 * self._texture.width * self._texture.height

    def release(self) -> None:
        """Free the image."""
        if self._texture is not None:
            self._texture.release()
            self._texture = None


@dataclass(frozen=True)
class CellRange:
    """Range of cells of one mip of one texture."""

    texture: int
    """Index of the texture in the store."""
    level: int
    first: int
    """First cell of the range, counted from the first cell of the mip."""
    count: int


class LatentUpdate:
    """Replacement of latents by a newer version: `textures` by index in the store, with unchanged sizes.

    Until `apply`, the store keeps its old latents, and may load more of them. Latents of another size than the old ones are not
    staged; `apply` then uploads the whole store again.
    """

    def __init__(self, store: LatentStore, textures: Mapping[int, EncodedTexture]) -> None:
        self._store, self._textures = store, textures
        self.fits = all(store.fits(index, texture) for index, texture in textures.items())
        """True if the new latents have the sizes of the old ones, and replace them in place."""
        self._staged: dict[tuple[int, int], int] = {}
        """Numbers of staged cells, by texture and mip."""
        self._batches: list[tuple[moderngl.Buffer, list[CellRange]]] = []

    def _missing(self) -> Iterator[CellRange]:
        """Yield the ranges of resident cells whose new version is not staged."""
        for index in self._textures if self.fits else ():
            rows = self._store.rows[index]
            for level in range(int(self._store.finest[index]), len(rows)):
                first = self._staged.get((index, level), 0)
                if first < rows[level].rows:
                    yield CellRange(index, level, first, rows[level].rows - first)

    @property
    def missing_bytes(self) -> int:
        """Number of bytes that are still to be uploaded."""
        return sum(part.count for part in self._missing()) * self._store.cell_bytes

    def _words(self, part: CellRange) -> bytes:
        start = self._store.rows[part.texture][part.level].first + part.first
        cells = slice(start, start + part.count)
        return self._store.tables.latent_words(self._textures[part.texture], cells).tobytes()

    def stage(self, budget_bytes: int) -> int:
        """Upload up to `budget_bytes`, at least one cell, to a staging buffer; return its number of bytes. Raises GpuMemoryError."""
        room = max(1, budget_bytes // self._store.cell_bytes)
        batch: list[CellRange] = []
        for part in self._missing():
            count = min(part.count, room)
            batch.append(CellRange(part.texture, part.level, part.first, count))
            room -= count
            if room == 0:
                break
        data = b"".join(self._words(part) for part in batch)
        self._batches.append((self._store.memory.buffer("latents to be replaced", data), batch))
        self._staged |= {(part.texture, part.level): part.first + part.count for part in batch}
        return len(data)

    def apply(self) -> int:
        """Upload the cells that are not staged, and copy all new latents into the store; return the number of bytes uploaded.

        This may change the store's `levels` and `finest`. Raises GpuMemoryError if the new latents are larger and do not fit.
        """
        store, uploaded = self._store, 0
        if not self.fits:
            return store.reload(self._textures)
        for part in self._missing():
            data = self._words(part)
            store.memory.write(store.buffer, data, self._offset(part))
            store.note_written(self._offset(part), self._offset(part) + len(data))
            uploaded += len(data)
        for buffer, batch in self._batches:
            start = 0
            for part in batch:
                size = part.count * store.cell_bytes
                # The store may have dropped mips since they were staged.
                if part.level >= store.finest[part.texture]:
                    store.gl.copy_buffer(store.buffer, buffer, size, read_offset=start, write_offset=self._offset(part))
                    store.note_written(self._offset(part), self._offset(part) + size)
                start += size
        store.replace_textures(self._textures)
        self.release()
        return uploaded

    def _offset(self, part: CellRange) -> int:
        row = int(self._store.first_level[part.texture]) + part.level
        return (int(self._store.levels[row]["first_cell"]) + part.first) * self._store.cell_bytes

    def release(self) -> None:
        """Free the staging buffers."""
        for buffer, _ in self._batches:
            buffer.release()
        self._batches.clear()
