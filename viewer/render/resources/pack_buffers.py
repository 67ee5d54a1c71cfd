"""Buffers of a pack: records, latents and weights as storage buffers, and each decoder as a range of a uniform buffer."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import WEIGHT_COLUMN_BITS, DecoderVariant, DecodingBinding, DecodingImage, DecodingUniform, GpuTables
from ntc.codec.maps import PLANES, Plane
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.registry import codec_of
from viewer.gl.allocation import GpuMemory, GpuMemoryError, replace_content
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.decoding_shaders import decoder_variant, precision_defines
from viewer.render.resources.latent_store import LatentBudget, LatentImage, LatentStore
from viewer.render.resources.layout import scene_includes
from viewer.state.view_state import Precision

ALL_LATENTS = LatentBudget(1 << 62)


class PackBuffers:
    """Buffers of one pack for a table of textures. Slot i is the pack's texture `texture_index[i]`; -1: empty slot.

    All latents are uploaded at once; with `on_demand`, those that `ensure_resident` names.
    """

    def __init__(
        self,
        context: GraphicsContext,
        pack: Pack,
        texture_index: Sequence[int],
        precision: Precision,
        emulate_half: bool = False,
        variant: DecoderVariant | None = None,
        on_demand: LatentBudget | None = None,
        rescale: bool = True,
    ) -> None:
        """Upload the pack. `variant`: that of the programs (None: the one for the driver).

        Without `rescale`, weights are stored unchanged even if halves overflow, for measuring the gain of rescaling.
        """
        self._context, self._memory, self._rescale = context, context.memory, rescale
        self.precision = precision
        self.pack = self.stored(pack)
        """Pack in the stored form of this precision."""
        self._texture_index = tuple(texture_index)
        self._tables = codec_of(pack.config).gpu_tables(pack.config, precision)
        self.network_blocks = self._tables.loop_length
        """Value of the decoding shaders' uniform of that name."""
        self.decodes_quads = self._tables.decodes_quads
        """True if an invocation decodes four texels of a tile (shaders/passes/decode_cached/decode.comp)."""
        self.variant = variant or decoder_variant(context)
        self.shares_decoders = self._tables.shares_decoders
        """True if programs read one decoder at a time, from a bound range."""
        self.decodes_together = bool(self._tables.together_shader and self.variant.together)
        """True if a work group decodes each code once for all of its pixels (`decode_together`)."""
        self.defines = {
            **precision_defines(context, self._tables.precision, emulate_half),
            "WEIGHTS_IN_IMAGE": int(self.variant.weights == "image"),
            # Without compute shaders, buffers are read as textures in any case.
            "LATENTS_IN_IMAGE": int(self.variant.weights == "image" and context.features.compute),
        }
        with context.memory.transaction():
            # Only textures of the table are uploaded, not those that the pack holds for other scenes.
            textures = [self.pack.textures[index] if index >= 0 else None for index in texture_index]
            self.latent_store = LatentStore(context, self._tables, textures, on_demand or ALL_LATENTS)
            self._latent_image = LatentImage(self.latent_store) if self.defines["LATENTS_IN_IMAGE"] else None
            self._records = np.zeros(max(1, len(textures)), self._tables.texture_record)
            self._fill_records()
            self._weights = self._make_weights()
            self._record_buffers: dict[DecodingBinding, moderngl.Buffer] = {
                DecodingBinding.TEXTURES: self._memory.buffer(
                    "tables of textures", self._records.tobytes(), storage=True
                ),
                DecodingBinding.LEVELS: self._memory.buffer(
                    "tables of textures", self.latent_store.levels.tobytes(), storage=True
                ),
            }
            if on_demand is None:
                self.ensure_resident(self.latent_store.all_levels())
                if not self.latent_store.has(self.latent_store.all_levels()):
                    # Measurements need all mips. Coarser ones would give wrong numbers.
                    raise GpuMemoryError(self.latent_store.refusal)

    def stored(self, pack: Pack) -> Pack:
        """Return `pack` in the stored form of these buffers: rescaled if the precision needs it."""
        return codec_of(pack.config).stored_pack(pack, self.precision) if self._rescale else pack

    def _textures(self, pack: Pack) -> Iterator[tuple[int, EncodedTexture]]:
        """Yield (slot, texture) of a version of this pack, without empty slots."""
        return ((slot, pack.textures[index]) for slot, index in enumerate(self._texture_index) if index >= 0)

    def _fill_records(self) -> None:
        records = self._records
        records["decoder"] = -1
        adapter = len(self.pack.decoders) * self._tables.decoder_blocks
        for slot, texture in self._textures(self.pack):
            self._tables.fill_record(records[slot], texture, int(self.latent_store.first_level[slot]), adapter)
            adapter += self._tables.adapter_blocks

    def _make_weights(self) -> moderngl.Buffer | moderngl.Texture:
        weights = self._tables.all_data(self.pack, [texture for _, texture in self._textures(self.pack)])
        made: moderngl.Buffer | moderngl.Texture
        if self.variant.weights == "image":
            made = weight_image(self._memory, weights, self._tables)
        else:
            made = self._memory.buffer("decoders", weights, storage=True)
        self._weight_bytes = len(weights)
        return made

    @property
    def decoder_of_texture(self) -> NDArray[np.int32]:
        """[slots of the table] int32 decoder of each texture, -1 for empty slots."""
        decoders: NDArray[np.int32] = self._records["decoder"][: len(self._texture_index)]
        return decoders

    def plane_components(self, plane: Plane) -> NDArray[np.int32]:
        """Return a bit for each of the plane's four components that a texture holds: [slots of the table] int32."""
        bits: NDArray[np.int32] = (self._records["components"] >> (4 * PLANES.index(plane))) & 15
        return bits

    def slots_of_groups(self, groups: Collection[int], pack: Pack) -> dict[int, EncodedTexture]:
        """Return the textures of these groups of `pack`, a version of this pack, by slot of the table."""
        return {slot: texture for slot, texture in self._textures(pack) if texture.group in groups}

    def replace_weights(self, pack: Pack, groups: Collection[int]) -> int:
        """Replace decoders, adapters and value ranges by those of `pack`, a newer version in the form of `stored`.

        `groups` are those that differ. Only their weights and records are uploaded, or all where textures have changed groups.
        Return the number of bytes uploaded. Raises GpuMemoryError, with nothing changed.
        """
        old, self.pack = self.pack, pack
        if [t.group for t in old.textures] != [t.group for t in pack.textures] or len(old.decoders) != len(
            pack.decoders
        ):
            try:
                weights = self._make_weights()
            except GpuMemoryError:
                self.pack = old
                raise
            self._weights.release()
            self._weights = weights
            self._fill_records()
            replace_content(self._record_buffers[DecodingBinding.TEXTURES], self._records.tobytes())
            return self._records.nbytes + self._weight_bytes
        self._fill_records()
        uploaded = 0
        for group in groups:
            first = group * self._tables.decoder_blocks
            uploaded += self._write_weights(first, self._tables.decoder_data(pack.decoders[group]))
        size = self._records.itemsize
        for slot, texture in self.slots_of_groups(groups, pack).items():
            self._memory.write(
                self._record_buffers[DecodingBinding.TEXTURES], self._records[slot].tobytes(), slot * size
            )
            uploaded += size
            uploaded += self._write_weights(int(self._records["adapter"][slot]), self._tables.adapter_data(texture))
        return uploaded

    def _write_weights(self, first_block: int, weights: bytes) -> int:
        """Write `weights` from block `first_block` on; return the number of bytes."""
        block_bytes = self._tables.block_bytes
        if isinstance(self._weights, moderngl.Buffer):
            self._memory.write(self._weights, weights, first_block * block_bytes)
            return len(weights)
        columns, start, end = 1 << WEIGHT_COLUMN_BITS, first_block, first_block + len(weights) // block_bytes
        while start < end:
            row, column = divmod(start, columns)
            count = min(columns - column, end - start)
            part = weights[(start - first_block) * block_bytes :][: count * block_bytes]
            self._weights.write(part, viewport=(column, row, count, 1))
            start += count
        return len(weights)

    @property
    def bytes_by_part(self) -> dict[str, int]:
        """Numbers of bytes on the GPU by use; adapters count as decoders."""
        tables = sum(buffer.size for buffer in self._record_buffers.values())
        parts = {"latents": self.latent_store.buffer.size, "decoders": self._weight_bytes, "tables": tables}
        return parts if self._latent_image is None else {**parts, "image of latents": self._latent_image.size}

    def ensure_resident(self, wanted: Mapping[int, int]) -> bool:
        """Upload the missing ones of these mips (finest mip by texture); return whether any was missing. Raises GpuMemoryError."""
        changed = self.latent_store.ensure_resident(wanted)
        if changed:
            self.note_latents()
        return changed

    def note_latents(self) -> None:
        """Upload the table of resident mips and their places, after the store has changed. Raises GpuMemoryError."""
        finest = self.latent_store.finest
        last = np.maximum(self._records["levels"][: len(finest)] - 1, 0)
        self._records["finest_level"][: len(finest)] = np.minimum(finest, last)
        replace_content(self._record_buffers[DecodingBinding.TEXTURES], self._records.tobytes())
        replace_content(self._record_buffers[DecodingBinding.LEVELS], self.latent_store.levels.tobytes())
        if self._latent_image is not None:
            self._latent_image.update()

    def bind_records(self) -> None:
        """Bind the records of textures and mips, for shaders that do not decode (ntc/records.glsl)."""
        for binding, buffer in self._record_buffers.items():
            self._context.bind_storage(buffer, int(binding))

    def bind(self) -> None:
        """Bind all buffers to their storage bindings."""
        self.bind_records()
        if self._latent_image is not None:
            self._context.bind_read_image(self._latent_image.update(), int(DecodingImage.LATENTS))
        else:
            self._context.bind_storage(self.latent_store.buffer, int(DecodingBinding.LATENTS))
        if isinstance(self._weights, moderngl.Buffer):
            self._context.bind_storage(self._weights, int(DecodingBinding.WEIGHTS))
        else:
            self._context.bind_read_image(self._weights, int(DecodingImage.WEIGHTS))

    def release(self) -> None:
        """Free the buffers."""
        for part in (self.latent_store, self._latent_image, self._weights, *self._record_buffers.values()):
            if part is not None:
                part.release()


def weight_image(memory: GpuMemory, weights: bytes, tables: GpuTables) -> moderngl.Texture:
    """Return `weights` as an image in rows of 2^WEIGHT_COLUMN_BITS blocks of four."""
    row_bytes = tables.block_bytes << WEIGHT_COLUMN_BITS
    rows = -(-len(weights) // row_bytes)
    padded = weights.ljust(rows * row_bytes, b"\0")
    return memory.texture("decoders", (1 << WEIGHT_COLUMN_BITS, rows), 4, padded, dtype=tables.number_type)


def scene_programs(context: GraphicsContext) -> ProgramFactory:
    """Return the factory of shaders that need no codec, in the GLSL version of the driver."""
    generated = scene_includes(context.memory.limits.groups_across)
    library = ShaderLibrary(shaders_folder(), generated, older=not context.features.compute)
    return ProgramFactory(context.gl, library, context.functions)


def codec_programs(factory: ProgramFactory, pack: Pack, variant: DecoderVariant) -> ProgramFactory:
    """Return `factory` with the decoding includes for the codec of `pack`, in the layout of `variant`."""
    return factory.with_generated(codec_of(pack.config).gpu_tables(pack.config).includes(variant))


LARGEST_ALIGNMENT = 256
"""Largest alignment of a buffer range in bytes that a driver may require (OpenGL 4.3, table 23.57)."""


class DecoderRanges:
    """Decoders of a pack as aligned ranges of a uniform buffer: each holds the weights, or their place among all weights."""

    def __init__(
        self, context: GraphicsContext, pack: Pack, precision: Precision, variant: DecoderVariant | None = None
    ) -> None:
        """Upload the decoders of the pack. `variant`: that of the programs (None: the one for the driver)."""
        codec = codec_of(pack.config)
        tables = codec.gpu_tables(pack.config, precision)
        variant = variant or decoder_variant(context)
        self.pixels = variant.pixels
        self._memory, self._tables = context.memory, tables
        blocks = tables.decoder_blocks
        # Halves are read in pairs of blocks, and the number of blocks may be odd.
        stored = blocks * 16 if precision == "fp32" else (blocks + 1) // 2 * 16
        fits = stored <= context.features.uniform_block_bytes
        self._places_only = not (tables.shares_decoders and variant.weights == "uniforms" and fits)
        self.defines = {"DECODER_PLACE": int(self._places_only)}
        """Defines of the shaders that read ranges (shaders/ntc/decoder_weights.glsl)."""
        self._size = 16 if self._places_only else stored
        self._stride = -(-self._size // LARGEST_ALIGNMENT) * LARGEST_ALIGNMENT
        self._count = len(pack.decoders)
        self._buffer = self._make(codec.stored_pack(pack, precision))

    def _range(self, pack: Pack, decoder: int) -> bytes:
        if self._places_only:
            start = decoder * self._tables.decoder_blocks
            return np.array([start, 0, 0, 0], "<i4").tobytes()
        return self._tables.decoder_data(pack.decoders[decoder])

    def _make(self, pack: Pack) -> moderngl.Buffer:
        ranges = [self._range(pack, decoder).ljust(self._stride, b"\0") for decoder in range(len(pack.decoders))]
        return self._memory.buffer("decoders", b"".join(ranges) or bytes(self._stride))

    def replace(self, pack: Pack, groups: Collection[int]) -> int:
        """Replace the decoders by those of `pack` (from `Codec.stored_pack`); `groups` differ. Return the number of bytes uploaded.

        Raises GpuMemoryError, with nothing changed.
        """
        if len(pack.decoders) != self._count:
            made = self._make(pack)
            self._buffer.release()
            self._buffer, self._count = made, len(pack.decoders)
            return made.size
        parts = {} if self._places_only else {group: self._range(pack, group) for group in groups}
        for group, part in parts.items():
            self._buffer.write(part, offset=group * self._stride)
        return sum(map(len, parts.values()))

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the buffer."""
        return self._buffer.size

    def bind(self, decoder: int) -> None:
        """Bind the range of this decoder."""
        place = {"offset": decoder * self._stride, "size": self._size}
        self._buffer.bind_to_uniform_block(int(DecodingUniform.DECODER), **place)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
