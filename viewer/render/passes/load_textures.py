"""GPU work of path `on-load`: decodes mips into an atlas of tiles, compresses them, and stores them in texture arrays."""

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
"""Place of a material's texture: array (-1: none), layer, a bit for each stored component, and the finest compressed mip."""
BATCH_TILES = LAYER_PAGES
"""Most tiles of a batch, unless a single piece has more."""
WHAT = "path on-load"


@dataclass(frozen=True)
class LoadCounts:
    """State of the textures of path `on-load`."""

    textures: int
    """Number of compressed textures, including unfinished ones."""
    left_out: int
    """Number of textures that no view has needed so far."""
    mips_left_out: int
    """Number of mips that are not compressed: those of `left_out`, and those that later frames add."""
    texels: int
    """Number of texels compressed so far, all mips and planes."""
    waiting: int
    """Number of texels that the last view still lacks."""
    bytes: int
    """Size of all arrays in bytes."""
    milliseconds: float
    """Time in ms of decoding and compressing so far."""
    squared_error: float
    """Sum of the squared errors of compression, in steps of 1/255. It may be older than `texels` if frames do not wait."""
    components: int
    """Number of component values that `squared_error` sums up."""
    coarse_latents: bool
    """True if mips were decoded from coarser latents than they need, because finer ones did not fit into the budget."""

    @property
    def texels_per_second(self) -> float:
        """Rate of decoding and compressing, in texels per second; 0 before the first."""
        return 1e3 * self.texels / self.milliseconds if self.milliseconds > 0.0 else 0.0

    @property
    def psnr_db(self) -> float | None:
        """PSNR in dB of compressed against decoded 8-bit texels, all mips; None before the first, or without loss."""
        if self.squared_error <= 0.0 or not self.components:
            return None
        return float(10.0 * np.log10(255.0**2 * self.components / self.squared_error))

    def figures(self) -> dict[str, float | int | None]:
        """Return the counts and rates for reports, by name."""
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
        """Return the sums of both counts."""
        sums = {each.name: getattr(self, each.name) + getattr(other, each.name) for each in fields(self)}
        return LoadCounts(**sums | {"coarse_latents": self.coarse_latents or other.coarse_latents})


@dataclass(frozen=True, eq=False)
class LoadedArray:
    """Textures of one size and sampler: one texture array for each stored part."""

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
    """Pass that compresses the textures of visible materials on the GPU, for one plane of a pack.

    It compresses all mips, coarse ones first, as many in a frame as its time budget allows. Textures whose latents or decoder have
    changed are compressed again; the old version is shown until then. ReferencePass draws them.
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
        """Finest mip of each texture such that it and all coarser ones are compressed."""
        self._pieces: dict[LoadedKey, list[MipRows]] = {}
        """Pieces that are not compressed yet, by texture."""
        self._places = np.zeros(max(1, plan.materials), PLACE)
        self._tile_ms: float | None = None
        self._texels = self._values = 0
        self._milliseconds = 0.0
        self._waiting = 0
        self._measured = 0.0, 0
        """Squared error at the last reading, and its number of values."""
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
        """Read the compression error that `counts` reports. Waits for the GPU."""
        if self._measured[1] != self._values:
            error = total_errors(np.frombuffer(self._errors.read(), np.uint32).reshape(-1, 2)).sum()
            self._measured = float(error), self._values

    @property
    def texture_bytes(self) -> int:
        """Number of bytes of the compressed textures."""
        return sum(array.bytes_on_gpu for _, array in self.arrays.values())

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of textures, tile atlas and tables."""
        tables = (self._tiles, self._entries, self._blocks, self._errors, self._material_places)
        return self.texture_bytes + self._atlas.bytes_on_gpu + sum(buffer.size for buffer in tables)

    def bind(self) -> None:
        """Bind the places of the materials' textures for the shader that samples them."""
        self._material_places.bind_to_storage_buffer(int(StorageBinding.RESULTS))

    def arrays_of(self, visible_materials: Sequence[int]) -> list[int]:
        """Return the numbers of the arrays that hold the textures of these materials, ascending."""
        return sorted({self._plan.places[key][0] for key in self._plan.wanted(visible_materials)})

    def advance(self, visible_materials: Sequence[int], _target: object, step: Step) -> Progress:
        """Decode and compress the missing textures of these materials: a frame's share, or all for a whole picture.

        For a new texture, all mips of a single tile are compressed at once. Raises GpuMemoryError.
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
        """Free the memory that only compressing needs, as an engine would after loading."""
        self._atlas.release()
        if self._blocks.size > 16:
            self._blocks.release()
            self._blocks = self._context.memory.buffer(WHAT, reserve=16)

    def _order(self, piece: MipRows) -> tuple[int, int]:
        """Return the sort key of a piece: small mips first."""
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
        plan, memory = self._plan.arrays[number], self._context.memory
        key = next(key for key, place in self._plan.places.items() if place[0] == number)
        levels, srgb = len(self._plan.levels[key.texture]), self._plane != "surface"
        with memory.transaction():
            parts = tuple(
                BlockArray(
                    self._context,
                    plan.size,
                    plan.layers,
                    levels,
                    part.block_format,
                    srgb and part.block_format == "bc7",
                    part.components,
                )
                for part in self._plan.parts
            )
        self.arrays[number] = plan, LoadedArray(parts)

    def _compress(self, pieces: Sequence[MipRows]) -> None:
        batch: list[MipRows] = []
        for piece in pieces:
            if batch and sum(each.tiles for each in batch) + piece.tiles > BATCH_TILES:
                self._compress_batch(batch)
                batch = []
            batch.append(piece)
        self._compress_batch(batch)
        for piece in pieces:
            left = self._pieces[piece.key]
            left.remove(piece)
            # Coarse mips come first, so all mips coarser than the remaining pieces are done.
            finest = 1 + max((each.level for each in left), default=-1)
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
            piece_records = records[start : start + piece.tiles]
            piece_records["texture_id"], piece_records["level"] = piece.key.texture, piece.level
            piece_records["tile_x"], piece_records["tile_y"] = tile_grid(piece)
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
        """Compress these scene textures again, because latents or decoders changed; the old version stays until then."""
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
        buffers: list[moderngl.Buffer | TileAtlas | LoadedArray] = [array for _, array in self.arrays.values()]
        buffers += [self._atlas, self._tiles, self._entries, self._blocks, self._errors, self._material_places]
        for part in buffers:
            part.release()
        self.arrays.clear()
