"""The tile cache where nothing computes (OpenGL 4.1): tiles are decoded by fragment shaders, and asked for by points."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemory
from viewer.gl.program import Defines, set_uniforms
from viewer.render.resources.layout import StorageBinding, TileBinding
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.render.tile_cache.decode_cached import FOLDER, DecodeCachedPass
from viewer.render.tile_cache.page_pool import LAYER_PAGES

ROW = 4096
"""Tiles in a row of the picture of all tiles."""


class DrawnTileCache(DecodeCachedPass):
    """Differs in what the GPU does. The CPU keeps the table of tiles, and tells shaders; they tell which tiles are read."""

    def _compile(self, defines: Defines) -> None:
        program = self._programs.program(f"{FOLDER}/decode.vert", f"{FOLDER}/decode.frag", defines)
        self._pages = self._gl.vertex_array(program, [])
        self._points: dict[moderngl.Program, moderngl.VertexArray] = {}

    def _make_tables(self, memory: GpuMemory) -> None:
        super()._make_tables(memory)
        entries = self._table.entries
        self._entries = np.zeros(entries, np.uint32)
        """[tiles] page + 1 of each; 0: it is missing."""
        self._read_tiles = memory.texture("tiles in sight", (min(entries, ROW), -(-entries // ROW)), 1)
        self._framebuffer = memory.framebuffer("tiles in sight", [self._read_tiles])

    @property
    def bytes_on_gpu(self) -> int:
        """Atlas and tables."""
        return super().bytes_on_gpu + self._read_tiles.width * self._read_tiles.height

    @property
    def _answer_bytes(self) -> int:
        return self._read_tiles.width * self._read_tiles.height

    def _ask(self, inputs: VisibilityInputs) -> None:
        defines = {**self._defines, "GRADIENTS": int(inputs.visibility.content.gradients)}
        program = self._programs.program(f"{FOLDER}/request.vert", f"{FOLDER}/request.frag", defines)
        if program not in self._points:
            self._points[program] = self._gl.vertex_array(program, [])
        self._framebuffer.use()
        self._framebuffer.clear()
        self._gl.enable_only(moderngl.NOTHING)
        set_uniforms(program, {"tiles_size": self._read_tiles.size, "anisotropy": inputs.anisotropy})
        width, height = inputs.visibility.size
        probes = inputs.anisotropy if defines["GRADIENTS"] else 1
        self._points[program].render(moderngl.POINTS, vertices=width * height, instances=1 + 2 * probes)
        self._back.copy_texture(self._read_tiles, self._answer_bytes, self._frame)

    def _told(self, content: bytes) -> NDArray[np.int64]:
        read = np.nonzero(np.frombuffer(content, np.uint8)[: self._table.entries])[0]
        pages = self._entries[read].astype(np.int64)
        self._used[:] = 0
        self._used[pages[pages > 0] - 1] = self._heard
        missing = read[pages == 0]
        self._unheard = max(0, len(missing) - self._most)
        return np.asarray(missing[: self._most], np.int64)

    def _run_decoders(self, tiles: NDArray[np.void], decoders: NDArray[np.int64]) -> None:
        del decoders
        tiles = tiles[np.argsort(tiles["page"], kind="stable")]
        layers = tiles["page"] // LAYER_PAGES
        self._buffers.bind()
        self._tiles.write(tiles.tobytes())
        self._context.bind_storage(self._tiles, int(StorageBinding.REQUESTS))
        program = self._pages.program
        set_uniforms(program, {"network_blocks": self._buffers.network_blocks})
        for layer in np.unique(layers).tolist():
            first, end = np.searchsorted(layers, (layer, layer + 1)).tolist()
            with self._atlas.drawing(layer):
                set_uniforms(program, {"first_tile": first})
                self._pages.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=end - first)
        self._entries[tiles["entry"]] = tiles["page"] + 1
        self._write_entries()

    def _invalidate_entries(self, entries: NDArray[np.int64]) -> None:
        if len(entries):
            self._entries[entries] = 0
            self._write_entries()

    def _write_entries(self) -> None:
        self._places[TileBinding.TILE_ENTRIES].write(self._entries.tobytes())

    def release(self) -> None:
        """Free atlas and tables."""
        super().release()
        for array in (self._pages, *self._points.values()):
            array.release()
        self._framebuffer.release()
        self._read_tiles.release()
