"""A pack on the GPU: records, latents and weights in storage buffers."""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.latents import latent_levels
from ntc.pack import Adapter, Pack
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.passes.latent_store import LatentBudget, LatentCounts, LatentStore
from viewer.passes.layout import StorageBinding, codec_layout_glsl, texture_record
from viewer.passes.network import NetworkLayout, network_glsl, shared_network_glsl, weight_bytes
from viewer.view_state import Precision


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
        on_demand: LatentBudget | None = None,
    ) -> None:
        config = pack.config
        network = NetworkLayout(config)
        self.hidden_blocks = network.hidden_blocks
        self.precision = precision
        textures = [pack.textures[index] if index >= 0 else None for index in texture_index]
        # Only what the table names is uploaded: latents of other scenes' textures cost nothing.
        self._latents = LatentStore(context.gl, config, textures, on_demand or LatentBudget())
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
        gl = context.gl
        self._buffers: dict[StorageBinding, moderngl.Buffer] = {
            StorageBinding.TEXTURES: gl.buffer(records.tobytes()),
            StorageBinding.LEVELS: gl.buffer(self._latents.levels.tobytes()),
            StorageBinding.WEIGHTS: gl.buffer(weight_bytes(config, pack.decoders, adapters, precision)),
        }
        if on_demand is None:
            self.need(self._latents.all_levels())

    @property
    def latents(self) -> LatentCounts:
        """What of the latents lies on the GPU."""
        return self._latents.counts

    @property
    def bytes_on_gpu(self) -> int:
        """All buffers."""
        return self._latents.buffer.size + sum(buffer.size for buffer in self._buffers.values())

    @property
    def bytes_by_part(self) -> Mapping[str, int]:
        """The same, by what it is for; adapters count as decoders."""
        weights = self._buffers[StorageBinding.WEIGHTS].size
        tables = sum(buffer.size for buffer in self._buffers.values()) - weights
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

    def release(self) -> None:
        """Free the buffers."""
        self._latents.release()
        for buffer in self._buffers.values():
            buffer.release()


def codec_programs(factory: ProgramFactory, pack: Pack) -> ProgramFactory:
    """`factory` with the includes that the decoding shaders need for the codec of `pack`."""
    return factory.with_generated(
        {
            "generated/codec.glsl": codec_layout_glsl(pack.config),
            "generated/network.glsl": network_glsl(pack.config),
            "generated/shared_network.glsl": shared_network_glsl(pack.config),
        }
    )
