"""A pack on the GPU: records, latents and weights in storage buffers."""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import latent_levels
from ntc.codec.rescale import stored_pack
from ntc.pack.model import Adapter, EncodedTexture, Pack
from viewer.gl.allocation import GpuMemory, GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.resources.latent_store import LatentBudget, LatentCounts, LatentStore
from viewer.render.resources.layout import (
    WEIGHT_COLUMN_BITS,
    ImageUnit,
    StorageBinding,
    codec_layout_glsl,
    texture_record,
)
from viewer.render.resources.network import (
    DEFAULT_NETWORK,
    NetworkConfig,
    NetworkLayout,
    network_glsl,
    shared_network_glsl,
    weight_bytes,
)
from viewer.render.resources.precision import precision_defines
from viewer.state.view_state import Precision

ALL_LATENTS = LatentBudget(1 << 62)


class PackBuffers:
    """Buffers of one pack for a table of textures: slot i is the pack's texture `texture_index[i]`, or none for -1.

    All latents are uploaded at once, or with `on_demand` those that `need` names.
    """

    def __init__(
        self,
        context: GraphicsContext,
        pack: Pack,
        texture_index: Sequence[int],
        precision: Precision,
        emulate_half: bool = False,
        weights_in_image: bool | None = None,
        on_demand: LatentBudget | None = None,
        rescale: bool = True,
    ) -> None:
        """`weights_in_image` None: on software renderers, which fetch from images several times faster than from buffers.

        Without `rescale` weights are stored as they are, even if halves overflow: for measuring what rescaling is worth.
        """
        pack = stored_pack(pack, precision) if rescale else pack
        config = pack.config
        network = NetworkLayout(config)
        self.hidden_blocks = network.hidden_blocks
        self.precision = precision
        textures = [pack.textures[index] if index >= 0 else None for index in texture_index]
        with context.memory.transaction():
            self._make(context, pack, textures, weights_in_image, on_demand)
        self.defines = {
            **precision_defines(context, precision, emulate_half),
            "WEIGHTS_IN_IMAGE": int(self.weights_in_image),
        }

    def _make(
        self,
        context: GraphicsContext,
        pack: Pack,
        textures: Sequence[EncodedTexture | None],
        weights_in_image: bool | None,
        on_demand: LatentBudget | None,
    ) -> None:
        config, memory = pack.config, context.memory
        network = NetworkLayout(config)
        # Only what the table names is uploaded: latents of other scenes' textures cost nothing.
        self._latents = LatentStore(context, config, textures, on_demand or ALL_LATENTS)
        records = np.zeros(max(1, len(textures)), texture_record(config))
        records["decoder"] = -1
        adapters: list[Adapter] = []
        for record, texture, first_level in zip(records, textures, self._latents.first_level, strict=False):
            if texture is None:
                continue
            record["first_level"] = first_level
            record["levels"] = len(latent_levels(texture.width, texture.height, config))
            record["decoder"], record["channels"] = texture.group, texture.channels
            record["srgb"] = texture.color_space == "srgb"
            record["adapter"] = len(pack.decoders) * network.blocks + len(adapters) * network.adapter_blocks
            if texture.adapter is not None:
                adapters.append(texture.adapter)
            record["scale"] = texture.scale.reshape(-1, 4)
            record["offset"] = texture.offset.reshape(-1, 4)
        self._records = records
        self._buffers: dict[StorageBinding, moderngl.Buffer] = {
            StorageBinding.TEXTURES: memory.buffer("tables of textures", records.tobytes()),
            StorageBinding.LEVELS: memory.buffer("tables of textures", self._latents.levels.tobytes()),
        }
        weights = weight_bytes(config, pack.decoders, adapters, self.precision)
        self._weight_image: moderngl.Texture | None = None
        if context.features.weights_in_image if weights_in_image is None else weights_in_image:
            self._weight_image = weight_image(memory, weights, self.precision)
        else:
            self._buffers[StorageBinding.WEIGHTS] = memory.buffer("decoders", weights)
        self.weights_in_image = self._weight_image is not None
        self._image_bytes = len(weights) if self._weight_image is not None else 0
        if on_demand is None:
            self.need(self._latents.all_levels())
            if not self._latents.has(self._latents.all_levels()):
                # Who wants all at once measures: coarser mips in their place would be wrong numbers.
                raise GpuMemoryError("latents: the GPU has no memory for all of them; close other programs")

    @property
    def latents(self) -> LatentCounts:
        """What of the latents lies on the GPU."""
        return self._latents.counts

    @property
    def bytes_on_gpu(self) -> int:
        """All buffers."""
        return self._image_bytes + self._latents.buffer.size + sum(buffer.size for buffer in self._buffers.values())

    @property
    def bytes_by_part(self) -> Mapping[str, int]:
        """The same, by what it is for; adapters count as decoders."""
        stored = self._buffers.get(StorageBinding.WEIGHTS)
        weights = self._image_bytes if stored is None else stored.size
        tables = sum(buffer.size for buffer in self._buffers.values()) - (0 if stored is None else weights)
        return {"latents": self._latents.buffer.size, "decoders": weights, "tables": tables}

    @property
    def latent_bytes(self) -> NDArray[np.int64]:
        """[slots of the table] int64: latents of each texture that are on the GPU."""
        return self._latents.bytes_by_texture

    def has(self, wanted: Mapping[int, int]) -> bool:
        """Whether these mips, given as finest mip by texture, are on the GPU."""
        return self._latents.has(wanted)

    def need(self, wanted: Mapping[int, int]) -> None:
        """Upload what is missing of these mips, given as finest mip by texture."""
        if self._latents.need(wanted):
            count = len(self._latents.finest)
            self._records["finest_level"][:count] = np.minimum(
                self._latents.finest, np.maximum(self._records["levels"][:count] - 1, 0)
            )
            self._buffers[StorageBinding.TEXTURES].write(self._records.tobytes())
            self._buffers[StorageBinding.LEVELS].write(self._latents.levels.tobytes())

    def bind(self) -> None:
        """Bind all buffers to their storage bindings."""
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(int(binding))
        self._latents.buffer.bind_to_storage_buffer(int(StorageBinding.LATENTS))
        if self._weight_image is not None:
            self._weight_image.bind_to_image(int(ImageUnit.WEIGHTS), read=True, write=False)

    def release(self) -> None:
        """Free the buffers."""
        self._latents.release()
        for buffer in self._buffers.values():
            buffer.release()
        if self._weight_image is not None:
            self._weight_image.release()


def weight_image(memory: GpuMemory, weights: bytes, precision: Precision) -> moderngl.Texture:
    """`weights` as an image in rows of 2^WEIGHT_COLUMN_BITS blocks of four."""
    kind = "f4" if precision == "fp32" else "f2"
    block_bytes = 4 * np.dtype(kind).itemsize
    rows = -(-len(weights) // (block_bytes << WEIGHT_COLUMN_BITS))
    padded = weights.ljust(rows * (block_bytes << WEIGHT_COLUMN_BITS), b"\0")
    return memory.texture("decoders", (1 << WEIGHT_COLUMN_BITS, rows), 4, padded, dtype=kind)


def codec_programs(factory: ProgramFactory, pack: Pack, network: NetworkConfig = DEFAULT_NETWORK) -> ProgramFactory:
    """`factory` with the includes that the decoding shaders need for the codec of `pack`."""
    return factory.with_generated(
        {
            "generated/codec.glsl": codec_layout_glsl(pack.config),
            "generated/network.glsl": network_glsl(pack.config),
            "generated/shared_network.glsl": shared_network_glsl(pack.config, network),
        }
    )
