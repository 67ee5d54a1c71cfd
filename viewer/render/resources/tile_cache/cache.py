"""GPU work of path `cached`: a virtual texture whose tiles are decoded on demand and filtered by the hardware.

Requests. A compute shader goes over the visible pixels. For each tile that a pixel's filter reads, it looks up the table of tiles. If
the tile has a page in the atlas, the shader writes the frame's number to that page, for eviction. If not, an atomic exchange marks the
entry TILE_REQUESTED, and the first invocation to do so appends the tile to a list, so each missing tile is listed once. The CPU reads
list and page numbers back, a frame or two later unless it waits. Because the marks stay, a list must always be read, and entries that
are dropped must be invalidated.

Decoding. Tiles that hold a whole mip come first, because they can replace any finer tile; then come coarse tiles before fine
ones. Pages are given by PagePool: free ones, then the least recently read. A frame decodes as many tiles as its time allows
(viewer/render/resources/tile_cache/budget.py). If all pages are visible, the remaining tiles are starved until the view changes.

Drawing. Each pixel filters within its tile's page; missing tiles are replaced by the finest coarser tile in the cache. This is the
method of "sparse virtual textures" (Barrett 2008; Mittring 2008), with decoding in place of loading. See
docs/explanation/decode-paths.md#cached and shaders/passes/decode_cached.
"""

from collections.abc import Collection

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemory, GpuMemoryError, replace_content
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.read_back import ReadBack
from viewer.gl.texture_arrays import TileAtlas
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import (
    ATLAS_SIDE,
    GROUP_SIDE,
    LATE_TILE_REQUESTS,
    MAX_TILE_REQUESTS,
    PAGE_SIDE,
    TEXEL_GROUP,
    TILE_LEVEL_RECORD,
    TILE_RECORD,
    StorageBinding,
    TextureUnit,
    TileBinding,
)
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers
from viewer.render.resources.tile_cache.budget import AHEAD_MILLISECONDS, TileBudget, TileCounts
from viewer.render.resources.tile_cache.tile_decoder import TileDecoder
from viewer.render.resources.tile_cache.tiles import LAYER_PAGES, PagePool, TileTable, finest_levels
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs

FOLDER = "passes/decode_cached"
PAGE_BYTES = 4 * PAGE_SIDE * PAGE_SIDE


class TileCache:
    """Tile cache on the GPU for one plane of a pack. A frame calls `request`, `decode` and `sample` in turn."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges,
        table: TileTable,
        reading: PlaneReading,
        budget: TileBudget,
    ) -> None:
        self._gl = context.gl
        # Frames that wait for the answer decode more tiles, so they request more.
        self._most = MAX_TILE_REQUESTS if context.waits else LATE_TILE_REQUESTS
        self._buffers, self._table, self._budget = buffers, table, budget
        self._programs, self._defines = programs, reading.defines()
        self._tile_decoder = TileDecoder(context, programs, buffers, ranges, reading)
        self._invalidate = programs.compute(f"{FOLDER}/invalidate.comp")
        self._pool = PagePool(max(1, min(budget.config.budget_bytes // PAGE_BYTES, table.entries)))
        self._atlas = TileAtlas(context, ATLAS_SIDE, srgb=reading.plane != "surface")
        self._out_of_memory = False
        self._coarse: NDArray[np.int64] = np.zeros(0, np.int64)
        """Entries of tiles that were decoded from coarser latents than they need, which did not fit."""
        with context.memory.transaction():
            if not self._atlas.grow(1):
                raise GpuMemoryError("path cached: the GPU has no memory for a tile cache; use path deferred or binned")
            self._make_tables(context.memory)
        self._back = ReadBack[int](context, "requested tiles")
        self._frame = self._answered = 0
        """Numbers of the last request, and of the last answered one."""
        self._used = np.zeros(self._pool.pages, np.uint32)
        """[pages] number of the last request that read each page, as of the last answer."""
        self._tiles_of = np.zeros(len(table.rows), np.int64)
        """[rows of the table] number of cached tiles of each texture, at its first row."""
        self._is_outdated = False
        """True if tiles were evicted after the last request, which took them to be present."""
        self._decoded_since: NDArray[np.int64] = np.zeros(0, np.int64)
        """Entries of fallback tiles that were decoded while a request was unanswered; its list may contain them."""
        self._waiting: NDArray[np.int64] = np.zeros(0, np.int64)
        self._stand_ins = 0
        """Number of tiles at the front of `_waiting` that are the only tile of their mip (fallbacks for finer tiles)."""
        self._stale: NDArray[np.int64] = np.zeros(0, np.int64)
        """Entries whose page holds an older version of the pack, shown until the new one is decoded."""
        self._starved = self._decoded = self._evicted = self._unlisted = self._reused = 0
        self._tile_ms: float | None = None

    def _make_tables(self, memory: GpuMemory) -> None:
        what, table = "tables of path cached", self._table
        levels = table.rows[["first_entry", "across"]].astype(TILE_LEVEL_RECORD)
        asked = min(self._most, table.entries)
        self._places: dict[StorageBinding | TileBinding, moderngl.Buffer] = {
            TileBinding.MATERIAL_TILES: memory.buffer(what, table.first_level_of_material.tobytes()),
            TileBinding.TILE_LEVELS: memory.buffer(what, levels.tobytes()),
            TileBinding.TILE_ENTRIES: memory.buffer(what, bytes(4 * table.entries)),
            TileBinding.PAGE_USED: memory.buffer(what, bytes(4 * self._pool.pages)),
            StorageBinding.RESULTS: memory.buffer(what, bytes(4 * (1 + asked))),
        }
        self._zero = memory.buffer(what, bytes(4))
        # Large enough for any call, because handling an answer must not fail for lack of memory.
        self._tiles = memory.buffer(what, reserve=TILE_RECORD.itemsize * max(asked, self._pool.pages))

    @property
    def counts(self) -> TileCounts:
        """State of the cache: numbers of tiles."""
        return TileCounts(
            self._pool.taken,
            len(self._waiting) + len(self._stale) + self._unlisted + (self.is_pending or self._is_outdated),
            self._starved,
            self._reused,
            self._decoded,
            self._evicted,
            self._out_of_memory,
            bool(len(self._coarse)),
        )

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of tile atlas and tables."""
        return self._atlas.bytes_on_gpu + sum(buffer.size for buffer in (*self._places.values(), self._tiles))

    def _bind_tables(self) -> None:
        """Bind the tables for shaders that read tiles. This unbinds the pack's latents and decoders."""
        self._buffers.bind_records()
        for binding, buffer in self._places.items():
            buffer.bind_to_storage_buffer(int(binding))

    @property
    def request_overflowed(self) -> bool:
        """True if all listed tiles are decoded and the view needs more than were listed, so it must be requested again."""
        return (self._unlisted > 0 or self._is_outdated) and not len(self._waiting)

    @property
    def is_pending(self) -> bool:
        """True while a request is unanswered; no tile waits to be decoded then."""
        return self._back.is_pending

    def request(self, inputs: VisibilityInputs) -> None:
        """Let the GPU list the tiles that this view reads and lacks; `answer` receives the list. One request is open at a time."""
        if self.is_pending:
            self.answer(waits=True)
        # The GPU lists a tile only once, so the memory for reading the list must be certain.
        self._back.reserve(self._answer_bytes)
        self._invalidate_entries(self._waiting)
        self._waiting, self._stand_ins, self._unlisted = self._waiting[:0], 0, 0
        self._decoded_since, self._is_outdated = self._decoded_since[:0], False
        self._frame += 1
        inputs.bind()
        self._bind_tables()
        self._ask(inputs)

    def _ask(self, inputs: VisibilityInputs) -> None:
        defines = {**self._defines, "GRADIENTS": int(inputs.visibility.content.gradients)}
        program = self._programs.compute(f"{FOLDER}/request.comp", defines)
        asked, used = self._places[StorageBinding.RESULTS], self._places[TileBinding.PAGE_USED]
        self._gl.copy_buffer(asked, self._zero, 4)
        set_uniforms(program, {"frame": self._frame, "anisotropy": inputs.anisotropy, "most_requests": self._most})
        program.run(*(-(-side // GROUP_SIDE) for side in inputs.visibility.size))
        self._gl.memory_barrier()
        self._back.copy([(asked, asked.size), (used, self._answer_bytes - asked.size)], self._frame)

    @property
    def _answer_bytes(self) -> int:
        return self._places[StorageBinding.RESULTS].size + 4 * max(1, self._pool.reach(0))

    def answer(self, waits: bool) -> bool:
        """Receive the list of missing tiles; return False if it has not arrived. With `waits`, wait for it."""
        arrived = self._back.arrived(waits)
        if arrived is None:
            return False
        content, self._answered = arrived
        entries = np.setdiff1d(self._missing_in(content), self._decoded_since)
        self._starved, self._reused = 0, self._pool.taken
        self._drop_unseen_stale()
        # The order is fixed, because atomics give list places by chance. Coarse tiles come first, single tiles of a mip before all:
        # they are shown in place of finer ones.
        tiles = self._table.tiles(entries)
        single = self._table.are_single(tiles["entry"].astype(np.int64))
        self._waiting = tiles["entry"][np.lexsort((-tiles["level"], ~single))].astype(np.int64)
        self._stand_ins = int(single.sum())
        return True

    def _missing_in(self, content: bytes) -> NDArray[np.int64]:
        """Return the entries of missing tiles in the answer; store how many are not listed, and when pages were read."""
        words = np.frombuffer(content, np.uint32)
        listed = self._places[StorageBinding.RESULTS].size // 4
        self._used[:] = 0
        self._used[: len(words) - listed] = words[listed:]
        count = min(int(words[0]), self._most, listed - 1)
        self._unlisted = int(words[0]) - count
        return words[1 : 1 + count].astype(np.int64)

    def decode_first(self, inputs: VisibilityInputs) -> None:
        """Decode fallback tiles of each texture that may be visible and has no tile, because it would be grey."""
        firsts = np.unique(self._table.first_level_of_material[list(inputs.visible_materials)]).astype(np.int64)
        missing = firsts[firsts >= 0]
        entries = self._table.stand_ins(missing[self._tiles_of[missing] == 0])
        if not len(entries):
            return
        waiting = ~np.isin(self._waiting, entries)
        self._stand_ins = int(waiting[: self._stand_ins].sum())
        self._waiting = self._waiting[waiting]
        done = self._place(entries)
        self._decoded_since = np.concatenate([self._decoded_since, entries[:done]])

    @property
    def only_stale(self) -> bool:
        """True if no tile is missing, but some show an older version of the pack."""
        return bool(len(self._stale)) and not len(self._waiting) and not self._unlisted

    @property
    def is_missing_tiles(self) -> bool:
        """True if listed tiles are not decoded yet; coarser ones are shown in their place."""
        return bool(len(self._waiting))

    @property
    def has_work(self) -> bool:
        """True if there are tiles to decode now."""
        return bool(len(self._waiting) or len(self._stale))

    def tiles_now(self, whole: bool) -> int:
        """Return the number of waiting tiles to decode in this frame; all for a `whole` picture.

        Fallback tiles are all decoded at once, because a texture without any is grey.
        """
        fitting = self._fitting(None if whole else self._budget.milliseconds, self._budget.config.least_tiles)
        return max(fitting, min(self._stand_ins, len(self._waiting)))

    def tiles_ahead(self) -> int:
        """Return the number of tiles to decode in a frame that keeps the old picture; smaller if none is missing."""
        least = self._budget.config.least_tiles if self.is_missing_tiles else 1
        return self._fitting(None if self._budget.config.milliseconds is None else AHEAD_MILLISECONDS, least)

    def _fitting(self, milliseconds: float | None, least: int) -> int:
        waiting = len(self._waiting) + len(self._stale)
        if milliseconds is None:
            return waiting
        return min(waiting, max(least, 0 if self._tile_ms is None else int(milliseconds / self._tile_ms)))

    def decode(self, count: int) -> int:
        """Decode the next `count` waiting tiles; return their number, which is smaller if all pages of the budget are visible."""
        missing = min(count, len(self._waiting))
        return self._decode_missing(missing) + self._decode_stale(count - missing)

    def _decode_missing(self, count: int) -> int:
        entries = self._waiting[:count]
        if not len(entries):
            return 0
        done = self._place(entries)
        if done < len(entries):
            # No page becomes free before the view changes.
            self._starved = len(self._waiting) - done
            self._invalidate_entries(self._waiting[done:])
            self._waiting = self._waiting[:done]
        self._waiting = self._waiting[done:]
        self._stand_ins = max(0, self._stand_ins - done)
        return done

    def _place(self, entries: NDArray[np.int64]) -> int:
        """Decode the first of these missing tiles, as many as get pages; return their number."""
        # Allocations, which may fail, come before tiles get pages.
        self._buffers.ensure_resident(finest_levels(self._table.tiles(entries)))
        if not self._atlas.grow(-(-self._pool.reach(len(entries)) // LAYER_PAGES)):
            # The GPU has less memory than the budget, so the pool shrinks to the memory it has.
            self._pool.shrink(self._atlas.layers * LAYER_PAGES)
            self._out_of_memory = True
        pages, gone = self._pool.place(entries, self._answered, lambda: self._used)
        self._count_tiles(gone, -1)
        self._invalidate_entries(gone)
        self._evicted += len(gone)
        self._is_outdated |= self.is_pending and len(gone) > 0
        if len(pages):
            self._count_tiles(entries[: len(pages)], 1)
            self._decode_into(entries[: len(pages)], pages)
        return len(pages)

    def _count_tiles(self, entries: NDArray[np.int64], change: int) -> None:
        np.add.at(self._tiles_of, self._table.textures(entries), change)

    def _decode_stale(self, count: int) -> int:
        """Decode stale tiles again, into the same pages."""
        entries = self._stale[:count]
        if len(entries):
            self._decode_into(entries, self._pool.pages_of(entries))
            self._stale = self._stale[len(entries) :]
        return len(entries)

    def _decode_into(self, entries: NDArray[np.int64], pages: NDArray[np.int64]) -> None:
        tiles = self._table.tiles(entries)
        tiles["page"] = pages
        self._buffers.ensure_resident(finest_levels(tiles))
        too_coarse = self._buffers.latent_store.finest[tiles["texture_id"]] > tiles["level"]
        self._coarse = np.union1d(np.setdiff1d(self._coarse, tiles["entry"]), tiles["entry"][too_coarse])
        decoders = self._buffers.decoder_of_texture[tiles["texture_id"]]
        order = np.argsort(decoders, kind="stable")
        # If the latents of a mip are not on the GPU, texels of the next coarser mip are filtered.
        self._run_decoders(tiles[order], decoders[order], too_coarse[order])
        self._decoded += len(pages)

    def retry_coarse(self) -> None:
        """Mark tiles stale that were decoded from coarse latents, because another view may leave room for finer ones."""
        coarse, self._coarse = np.intersect1d(self._coarse, self._pool.held()), self._coarse[:0]
        self._stale = np.concatenate([self._stale, np.setdiff1d(coarse, self._stale)])

    def _drop_unseen_stale(self) -> None:
        """Drop stale tiles that the last request did not read."""
        if not len(self._stale):
            return
        stale = self._stale[np.isin(self._stale, self._pool.held())]
        seen = self._pool.needed_in(self._pool.pages_of(stale), self._answered, self._used)
        self._pool.drop(stale[~seen])
        self._count_tiles(stale[~seen], -1)
        self._invalidate_entries(stale[~seen])
        self._stale = stale[seen]

    def note_time(self, tiles: int, milliseconds: float) -> None:
        """Store the time of decoding `tiles` tiles, in ms."""
        if tiles:
            self._tile_ms = milliseconds / tiles
            self._budget.note_tiles(milliseconds)

    def _run_decoders(
        self, tiles: NDArray[np.void], decoders: NDArray[np.int64], too_coarse: NDArray[np.bool_]
    ) -> None:
        self._places[TileBinding.TILE_ENTRIES].bind_to_storage_buffer(int(TileBinding.TILE_ENTRIES))
        self._write_tiles(tiles.tobytes())
        self._tile_decoder.run(decoders, too_coarse, self._atlas)

    def _write_tiles(self, data: bytes) -> None:
        replace_content(self._tiles, data)
        self._tiles.bind_to_storage_buffer(int(StorageBinding.REQUESTS))

    def _invalidate_entries(self, entries: NDArray[np.int64]) -> None:
        if not len(entries):
            return
        self._places[TileBinding.TILE_ENTRIES].bind_to_storage_buffer(int(TileBinding.TILE_ENTRIES))
        self._write_tiles(entries.astype(np.uint32).tobytes())
        set_uniforms(self._invalidate, {"count": len(entries)})
        self._invalidate.run(-(-len(entries) // TEXEL_GROUP))
        self._gl.memory_barrier()

    def sample(self, inputs: VisibilityInputs, target: ColorTarget, band: tuple[int, int] = (0, 1)) -> None:
        """Draw the plane from the decoded tiles. `band` (number, count): draw only this part of the rows."""
        defines = {**self._defines, "GRADIENTS": int(inputs.visibility.content.gradients)}
        triangle = self._programs.fullscreen(f"{FOLDER}/sample.frag", defines)
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        inputs.bind()
        self._bind_tables()
        self._atlas.use(int(TextureUnit.ATLAS))
        set_uniforms(triangle.program, {"depth": 0.0, "anisotropy": inputs.anisotropy})
        low, high = (target.size[1] * number // band[1] for number in (band[0], band[0] + 1))
        target.framebuffer.scissor = (0, low, target.size[0], high - low)
        try:
            triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            target.framebuffer.scissor = (0, 0, *target.size)

    def mark_stale(self, textures: Collection[int]) -> None:
        """Decode the tiles of these scene textures again, because latents or decoders changed; old tiles are shown until then.

        Tiles of other textures, and the last request, stay valid.
        """
        held = self._pool.held()
        changed = held[np.isin(self._table.tiles(held)["texture_id"], list(textures))]
        # New ones go to the end, or earlier ones might wait for ever.
        self._stale = np.concatenate([self._stale, np.setdiff1d(changed, self._stale)])
        self._drop_unseen_stale()

    def release(self) -> None:
        """Free tile atlas and tables."""
        self._back.release()
        self._atlas.release()
        for buffer in (self._tiles, self._zero, *self._places.values()):
            buffer.release()
