"""New latents of some textures on their way to the GPU: staged over several frames, then copied all at once."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import moderngl

from ntc.codec.model import EncodedTexture
from viewer.render.resources.latent_store import LatentStore


@dataclass(frozen=True)
class CellRange:
    """Some cells of one mip of one texture."""

    texture: int
    """Index in the store."""
    level: int
    first: int
    """Counted from the first cell of the mip."""
    count: int


class LatentUpdate:
    """Replaces the latents of `textures`, given by index in the store, by others of textures of the same sizes.

    The store keeps its old latents, and may load more of them, until `apply`. Latents that take other room than before are not
    staged: with them the store is filled anew.
    """

    def __init__(self, store: LatentStore, textures: Mapping[int, EncodedTexture]) -> None:
        self._store, self._textures = store, textures
        self.fits = all(store.fits(index, texture) for index, texture in textures.items())
        """Whether the new latents take the places of the old ones."""
        self._staged: dict[tuple[int, int], int] = {}
        """Cells that are staged, by texture and mip."""
        self._batches: list[tuple[moderngl.Buffer, list[CellRange]]] = []

    def _missing(self) -> Iterator[CellRange]:
        """Cells on the GPU whose new version is not staged."""
        for index in self._textures if self.fits else ():
            rows = self._store.rows[index]
            for level in range(int(self._store.finest[index]), len(rows)):
                first = self._staged.get((index, level), 0)
                if first < rows[level].rows:
                    yield CellRange(index, level, first, rows[level].rows - first)

    @property
    def missing_bytes(self) -> int:
        """Bytes that are still to be uploaded."""
        return sum(part.count for part in self._missing()) * self._store.cell_bytes

    def _words(self, part: CellRange) -> bytes:
        start = self._store.rows[part.texture][part.level].first + part.first
        cells = slice(start, start + part.count)
        return self._store.tables.latent_words(self._textures[part.texture], cells).tobytes()

    def stage(self, budget_bytes: int) -> int:
        """Upload up to `budget_bytes`, and at least one cell, to a buffer beside the store; the bytes. Raises GpuMemoryError."""
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
        """Upload what is not staged, and have the store hold the new latents; the bytes uploaded.

        The store's `levels` and `finest` may then be others. Raises GpuMemoryError where latents take more room than before.
        """
        store, uploaded = self._store, 0
        if not self.fits:
            return store.reload(self._textures)
        for part in self._missing():
            data = self._words(part)
            store.memory.write(store.buffer, data, self._offset(part))
            uploaded += len(data)
        for buffer, batch in self._batches:
            start = 0
            for part in batch:
                size = part.count * store.cell_bytes
                # The store may have dropped mips since they were staged.
                if part.level >= store.finest[part.texture]:
                    store.gl.copy_buffer(store.buffer, buffer, size, read_offset=start, write_offset=self._offset(part))
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
