"""The GPU's work of path `on-load`: mips are decoded into an atlas of tiles, compressed, and kept in arrays that samplers read."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.texture_arrays import BlockArray, GpuBlockFormat, TileAtlas, blocks_bytes
from viewer.gl.timer import PassTimer
from viewer.render.pass_scheduler import Pending, Progress, RenderPass, Step
from viewer.render.resources.block_compressor import BlockCompressor, total_errors
from viewer.render.resources.image_places import ImageArrayPlan
from viewer.render.resources.layout import (
    ATLAS_SIDE,
    TILE_RECORD,
    TILE_SIDE,
    StorageBinding,
    TextureUnit,
    TileBinding,
)
from viewer.render.resources.load_plan import LoadedKey, LoadPlan, MipRows, tile_grid
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers
from viewer.render.resources.tile_cache.budget import TileBudget
from viewer.render.resources.tile_cache.tile_decoder import TileDecoder
from viewer.render.resources.tile_cache.tiles import LAYER_PAGES, finest_levels
from viewer.render.resources.visibility_buffer import PlaneReading

PLACE = np.dtype([(name, "<i4") for name in ("array", "layer", "components", "finest")])
"""Place of a material's texture: array (-1: none) and layer, a bit for each component that it holds, and the finest mip there."""
BATCH_TILES = LAYER_PAGES
"""Most tiles of a batch, unless a piece has more."""
WHAT = "path on-load"


@dataclass(frozen=True)
class LoadCounts:
    """State of the textures of path `on-load`."""

    textures: int
    """Number of compressed textures, those under way included."""
    left_out: int
    """Number of textures that no view has needed so far."""
    mips_left_out: int
    """Number of mips that are not compressed: of those textures, and those that later frames add."""
    texels: int
    """Number of texels compressed so far, all mips and planes."""
    waiting: int
    """Number of texels that are still to be compressed for the last view."""
    bytes: int
    """Size of all arrays in bytes."""
    milliseconds: float
    """Time in ms of decoding and compressing so far."""
    squared_error: float
    """Sum of the squared errors of compression, in steps of 1/255; as far as it is known, where frames do not wait."""
    components: int
    """Number of component values that `squared_error` is of."""
    coarse_latents: bool
    """True where mips were decoded from coarser latents than they need, for want of room."""

    @property
    def texels_per_second(self) -> float:
        """Texels decoded and compressed in a second; 0 before the first."""
        return 1e3 * self.texels / self.milliseconds if self.milliseconds > 0.0 else 0.0

    @property
    def psnr_db(self) -> float | None:
        """PSNR in dB of the compressed texels against the decoded ones in 8 bits, all mips; None before the first or without loss."""
        if self.squared_error <= 0.0 or not self.components:
            return None
        return float(10.0 * np.log10(255.0**2 * self.components / self.squared_error))

    def figures(self) -> dict[str, float | int | None]:
        """Return the figures for reports."""
        return {
            "textures": self.textures,
            "texels": self.texels,
            "texels_waiting": self.waiting,
            "bytes": self.bytes,
            "milliseconds": self.milliseconds,
            "megatexels_per_second": 1e-6 * self.texels_per_second,
            "compression_psnr_db": self.psnr_db,
        }

    def plus(self, other: "LoadCounts") -> "LoadCounts":
        """Return the counts of both together."""
        sums = {own.name: getattr(self, own.name) + getattr(other, own.name) for own in fields(self)}
        return LoadCounts(**sums | {"coarse_latents": self.coarse_latents or other.coarse_latents})


@dataclass(frozen=True, eq=False)
class LoadedArray:
    """Textures of one size and sampler: an array for each stored part."""

    parts: tuple[BlockArray, ...]

    def use(self, unit: int) -> None:
        """Bind the first part to a texture unit, the second to TextureUnit.SECOND_IMAGES."""
        for part, place in zip(self.parts, (unit, int(TextureUnit.SECOND_IMAGES)), strict=False):
            part.use(place)

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of all parts."""
        return sum(part.bytes_on_gpu for part in self.parts)

    def release(self) -> None:
        """Free the textures."""
        for part in self.parts:
            part.release()


class LoadedTextures(RenderPass[Sequence[int], object]):
    """Pass that keeps the textures of one plane of a pack compressed on the GPU that the visible materials need.

    All mips, the coarse ones first, as many in a frame as its time allows. Textures whose latents or decoder have changed are
    compressed again, and shown as they were until then. ReferencePass draws them.
    """

    name = "compress"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges,
        plan: LoadPlan,
        reading: PlaneReading,
        timer: PassTimer,
        budget: TileBudget,
    ) -> None:
        """Take the materials' places from `plan`. Raises GpuMemoryError, ShaderError."""
        self._context, self._buffers, self._plan, self._plane = context, buffers, plan, reading.plane
        self._timer, self._budget = timer, budget
        self._decoder = TileDecoder(context, programs, buffers, ranges, reading)
        self._compressors: dict[GpuBlockFormat, BlockCompressor] = {
            part.block_format: BlockCompressor(context, programs, part.block_format, from_tiles=True)
            for part in plan.parts
        }
        parts = len(plan.parts)
        self.units = (TextureUnit.IMAGES, TextureUnit.SECOND_IMAGES)[: max(1, parts)]
        """Texture units of an array."""
        self.defines = {"LOADED": 1, "PARTS": max(1, parts)}
        """Defines of the shader that samples them."""
        self.arrays: dict[int, tuple[ImageArrayPlan, LoadedArray]] = {}
        """Texture arrays that shaders sample, by number."""
        self._finest: dict[LoadedKey, int] = {}
        """Finest mip of each texture from which on all are there."""
        self._pieces: dict[LoadedKey, list[MipRows]] = {}
        """Pieces that are still to be compressed."""
        self._places = np.zeros(max(1, plan.materials), PLACE)
        self._tile_ms: float | None = None
        self._texels = self._values = 0
        self._milliseconds = 0.0
        self._waiting = 0
        self._measured = 0.0, 0
        """Squared error as it was read last, and the number of values that it is of."""
        self._coarse: set[LoadedKey] = set()
        with context.memory.transaction():
            memory = context.memory
            self._atlas = TileAtlas(context, ATLAS_SIDE, srgb=False)
            self._tiles = memory.buffer(WHAT, reserve=TILE_RECORD.itemsize * BATCH_TILES)
            self._entries = memory.buffer(WHAT, reserve=4 * BATCH_TILES)
            self._blocks = memory.buffer(WHAT, reserve=16)
            self._errors = memory.buffer(WHAT, bytes(8))
            self._material_places = memory.buffer(WHAT, self._places.tobytes())
        self._write_places()

    @property
    def counts(self) -> LoadCounts:
        """State of the textures."""
        if self._context.waits:
            self.measure()
        levels = self._plan.levels
        return LoadCounts(
            len(self._finest),
            len(self._plan.places) - len(self._finest),
            sum(self._finest.get(key, len(levels[key.texture])) for key in self._plan.places),
            self._texels,
            self._waiting,
            self.texture_bytes,
            self._milliseconds,
            *self._measured,
            bool(self._coarse),
        )

    def measure(self) -> None:
        """Read the error of compression, for `counts`. Waits for the GPU."""
        if self._measured[1] != self._values:
            error = total_errors(np.frombuffer(self._errors.read(), np.uint32).reshape(-1, 2)).sum()
            self._measured = float(error), self._values

    @property
    def texture_bytes(self) -> int:
        """Number of bytes of the compressed textures."""
        return sum(array.bytes_on_gpu for _, array in self.arrays.values())

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of textures, atlas and tables."""
        own = (self._tiles, self._entries, self._blocks, self._errors, self._material_places)
        return self.texture_bytes + self._atlas.bytes_on_gpu + sum(buffer.size for buffer in own)

    def bind(self) -> None:
        """Bind the places of the materials' textures for the shader that samples them."""
        self._material_places.bind_to_storage_buffer(int(StorageBinding.RESULTS))

    def arrays_of(self, visible_materials: Sequence[int]) -> list[int]:
        """Return the numbers of the arrays that hold the textures of these materials, ascending."""
        return sorted({self._plan.places[key][0] for key in self._plan.wanted(visible_materials)})

    def advance(self, visible_materials: Sequence[int], _target: object, step: Step) -> Progress:
        """Decode and compress what these materials need and is not there, a frame's share of it, or all for a whole picture.

        Of a texture that is not there yet all mips of one tile are compressed at once. Raises GpuMemoryError.
        """
        wanted = self._plan.wanted(visible_materials)
        for key in wanted:
            if key not in self._finest:
                self._make_array(self._plan.places[key][0])
                self._finest[key] = len(self._plan.levels[key.texture])
                self._pieces[key] = self._plan.pieces(key)
        pending = [piece for key in wanted for piece in self._pieces.get(key, ())]
        done = self._take(sorted(pending, key=self._order), step.budget.is_whole)
        if done:
            self._compress(done)
        left = sum(bool(self._pieces.get(key)) for key in wanted)
        if not left:
            self._free_working_memory()
        self._waiting = sum(piece.texels for key in wanted for piece in self._pieces.get(key, ()))
        return Progress(bool(done), (Pending("loads", left, len(wanted)),) if left else ())

    def _free_working_memory(self) -> None:
        """Free what only compressing needs, for an engine would."""
        self._atlas.release()
        if self._blocks.size > 16:
            self._blocks.release()
            self._blocks = self._context.memory.buffer(WHAT, reserve=16)

    def _order(self, piece: MipRows) -> tuple[int, int]:
        """Return the key by which pieces are sorted: those of small mips first."""
        level = self._plan.levels[piece.key.texture][piece.level]
        return level.texel_width * level.texel_height, piece.top

    def _take(self, pending: Sequence[MipRows], whole: bool) -> list[MipRows]:
        """Return the pieces to compress in this frame."""
        milliseconds = None if whole else self._budget.milliseconds
        if milliseconds is None:
            return list(pending)
        least = self._budget.config.least_tiles
        room = max(least, 0 if self._tile_ms is None else int(milliseconds / self._tile_ms))
        taken = []
        for piece in pending:
            first = self._finest[piece.key] == len(self._plan.levels[piece.key.texture])
            if piece.tiles > 1 or not first:
                if room <= 0:
                    break
                room -= piece.tiles
            taken.append(piece)
        return taken

    def _make_array(self, number: int) -> None:
        if number in self.arrays:
            return
        own, memory = self._plan.arrays[number], self._context.memory
        key = next(key for key, place in self._plan.places.items() if place[0] == number)
        levels, srgb = len(self._plan.levels[key.texture]), self._plane != "surface"
        with memory.transaction():
            parts = tuple(
                BlockArray(
                    self._context,
                    own.size,
                    own.layers,
                    levels,
                    part.block_format,
                    srgb and part.block_format == "bc7",
                    part.components,
                )
                for part in self._plan.parts
            )
        self.arrays[number] = own, LoadedArray(parts)

    def _compress(self, pieces: Sequence[MipRows]) -> None:
        batch: list[MipRows] = []
        for piece in pieces:
            if batch and sum(own.tiles for own in batch) + piece.tiles > BATCH_TILES:
                self._compress_batch(batch)
                batch = []
            batch.append(piece)
        self._compress_batch(batch)
        for piece in pieces:
            left = self._pieces[piece.key]
            left.remove(piece)
            # Coarse mips come first: all beyond the first piece that is left are there.
            finest = 1 + max((own.level for own in left), default=-1)
            self._finest[piece.key] = min(self._finest[piece.key], finest)
        self._write_places()

    def _compress_batch(self, batch: Sequence[MipRows]) -> None:
        tiles = sum(piece.tiles for piece in batch)

        def note(milliseconds: float) -> None:
            self._tile_ms = milliseconds / tiles
            self._milliseconds += milliseconds
            self._budget.note_tiles(milliseconds)

        with self._timer.watch(note):
            self._decode(batch, tiles)
            self._compress_tiles(batch)

    def _decode(self, batch: Sequence[MipRows], count: int) -> None:
        """Decode the tiles of a batch into the first pages of the atlas, piece by piece, row by row."""
        memory = self._context.memory
        records = np.zeros(count, TILE_RECORD)
        start = 0
        for piece in batch:
            own = records[start : start + piece.tiles]
            own["texture_id"], own["level"] = piece.key.texture, piece.level
            own["tile_x"], own["tile_y"] = tile_grid(piece)
            start += piece.tiles
        records["page"] = records["entry"] = np.arange(count)
        self._buffers.ensure_resident(finest_levels(records))
        too_coarse: NDArray[np.bool_] = self._buffers.latent_store.finest[records["texture_id"]] > records["level"]
        for key in {piece.key for piece in batch}:
            (self._coarse.add if np.any(too_coarse[records["texture_id"] == key.texture]) else self._coarse.discard)(
                key
            )
        decoders = self._buffers.decoder_of_texture[records["texture_id"]].astype(np.int64)
        order = np.lexsort((too_coarse, decoders))
        if not self._atlas.grow(-(-count // LAYER_PAGES)):
            raise GpuMemoryError("path on-load: the GPU has no memory for decoded tiles; use path deferred")
        data = records[order].tobytes()
        self._tiles = memory.grown(WHAT, self._tiles, len(data))
        self._entries = memory.grown(WHAT, self._entries, 4 * count)
        self._tiles.orphan()
        self._tiles.write(data)
        self._tiles.bind_to_storage_buffer(int(StorageBinding.REQUESTS))
        self._entries.bind_to_storage_buffer(int(TileBinding.TILE_ENTRIES))
        self._decoder.run(decoders[order], too_coarse[order], self._atlas)

    def _compress_tiles(self, batch: Sequence[MipRows]) -> None:
        """Compress the first pages of the atlas, and copy the blocks to their textures."""
        parts = self._plan.parts
        needed = sum(blocks_bytes(piece.size, part.block_format) for piece in batch for part in parts)
        self._blocks = self._context.memory.grown(WHAT, self._blocks, needed, storage=True)
        self._atlas.use_stored(int(TextureUnit.ATLAS))
        place, places = 0, []
        for number, part in enumerate(parts):
            page, compressor = 0, self._compressors[part.block_format]
            for piece in batch:
                compressor.run(
                    piece.size,
                    self._blocks,
                    self._errors,
                    first_component=part.components.start,
                    first_byte=place,
                    tiles=(page, piece.across),
                    has_alpha=len(part.components) == 4,
                )
                places.append((number, piece, place))
                place += blocks_bytes(piece.size, part.block_format)
                page += piece.tiles
        for number, piece, place in places:
            array, layer = self._plan.places[piece.key]
            part_array = self.arrays[array][1].parts[number]
            part_array.write(layer, piece.level, piece.top * TILE_SIDE, piece.size, self._blocks, place)
        self._texels += sum(piece.texels for piece in batch)
        self._values += sum(piece.texels * min(3, len(part.components)) for piece in batch for part in parts)

    def mark_stale(self, textures: Collection[int]) -> None:
        """Compress these scene textures anew, whose latents or decoder have changed; they are shown as they are until then."""
        for key in self._finest:
            if key.texture in textures:
                self._pieces[key] = self._plan.pieces(key)

    def _write_places(self) -> None:
        components = self._buffers.plane_components(self._plane)
        self._places["array"] = -1
        for material, key in self._plan.keys.items():
            finest = self._finest.get(key)
            if finest is not None and finest < len(self._plan.levels[key.texture]):
                self._places[material] = (*self._plan.places[key], components[key.texture], finest)
        self._material_places.orphan()
        self._material_places.write(self._places.tobytes())

    def release(self) -> None:
        """Free everything."""
        own: list[moderngl.Buffer | TileAtlas | LoadedArray] = [array for _, array in self.arrays.values()]
        own += [self._atlas, self._tiles, self._entries, self._blocks, self._errors, self._material_places]
        for part in own:
            part.release()
        self.arrays.clear()
