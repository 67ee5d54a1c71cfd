"""Format 1 of codec `block`: its packs stay readable; nothing is encoded in it (docs/reference/codec-block-1.md)."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec import block_storage
from ntc.codec.block_1 import tensors as files
from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.gpu import BlockTables
from ntc.codec.block_1.model import BlockDecoder, BlockTexture, block_parts
from ntc.codec.block_1.reference import decode_image, lookup_values
from ntc.codec.block_1.universal import VERSION
from ntc.codec.codec import Codec, Tensors, TensorShape, TextureBytes, TorchTwin
from ntc.codec.config import Precision, WrapMode
from ntc.codec.encoding import (
    DEFAULT_BITS,
    BitsTarget,
    Encoder,
    EncodingChoices,
    EncodingOptions,
    EncodingTask,
    TextureSet,
)
from ntc.codec.gpu import GpuTables
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.registry import FORMER_FORMATS, codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError


def _present() -> Codec:
    return codec_named(FORMER_FORMATS[BlockConfig.kind])


class FirstBlockCodec(Codec):
    """Decoded in single precision."""

    settings_type = BlockConfig
    trains = False
    default_target = BitsTarget(DEFAULT_BITS)
    default_maps = "all"
    psnr_title = "PSNR of mip 0"
    shipped = MappingProxyType({"version": VERSION})
    uncertified = "certified bounds of the error: for codec grid alone; codec block decodes in fp32 at every precision"
    table_text = "bases and bit allocations"

    def texture_shapes(self, settings: CodecSettings, width: int, height: int) -> dict[str, TensorShape]:
        del width, height
        config = cast(BlockConfig, settings)
        return block_storage.texture_shapes(config, (config.output_channels,))

    def decoder_shapes(self, settings: CodecSettings) -> dict[str, TensorShape]:
        return files.decoder_shapes(cast(BlockConfig, settings))

    def texture_tensors(self, texture: EncodedTexture, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return block_storage.texture_tensors(cast(BlockTexture, texture), cast(BlockConfig, settings))

    def decoder_tensors(self, decoder: Decoder, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return files.decoder_tensors(cast(BlockDecoder, decoder), cast(BlockConfig, settings))

    def read_texture(self, tensors: Tensors, known: Mapping[str, Any], settings: CodecSettings) -> EncodedTexture:
        return block_storage.read_texture(tensors, known, cast(BlockConfig, settings), BlockTexture)

    def read_decoder(self, tensors: Tensors, settings: CodecSettings) -> Decoder:
        return files.read_decoder(tensors, cast(BlockConfig, settings))

    def shipped_decoder(self, decoders: int, parameters: Mapping[str, Any], settings: CodecSettings) -> Decoder:
        return files.shipped_decoder(decoders, parameters, cast(BlockConfig, settings))

    def texture_bytes(self, texture: EncodedTexture, settings: CodecSettings) -> TextureBytes:
        own, config = cast(BlockTexture, texture), cast(BlockConfig, settings)
        return TextureBytes(own.words.nbytes, own.mean.nbytes + 4 * config.axis_numbers)

    def decoder_bytes(self, decoder: Decoder, settings: CodecSettings) -> int:
        return cast(BlockDecoder, decoder).stored_bits(cast(BlockConfig, settings)) // 8

    def reference_values(
        self,
        pack: Pack,
        texture_index: int,
        uv: NDArray[np.float64],
        lod: NDArray[np.float64],
        wrap: tuple[WrapMode, WrapMode],
    ) -> NDArray[np.float64]:
        own = block_parts(pack)
        texture = own.textures[texture_index]
        return lookup_values(texture, own.decoders[texture.group], own.config, uv, lod, wrap)

    def reference_image(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.uint8]:
        own = block_parts(pack)
        texture = own.textures[texture_index]
        image = decode_image(texture, own.decoders[texture.group], own.config, level)
        return image[..., texture.places(own.config)]

    def torch_twin(
        self,
        pack: Pack,
        device: str,
        interruption: Callable[[], None] = lambda: None,
    ) -> TorchTwin:
        from ntc.codec.block_1.torch_twin import TorchBlock

        return TorchBlock(pack, device, interruption)

    def gpu_tables(self, settings: CodecSettings, precision: Precision = "fp32") -> GpuTables:
        del precision
        return BlockTables(cast(BlockConfig, settings))

    # What is encoded anew is encoded in the present format.

    def refusals(self, choices: EncodingChoices) -> list[str]:
        return _present().refusals(choices)

    def settings_for(self, textures: TextureSet, choices: EncodingChoices) -> CodecSettings:
        return _present().settings_for(textures, choices)

    def options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return _present().options_for(choices)

    def live_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return _present().live_options_for(choices)

    def job_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return _present().job_options_for(choices)

    def recorded_options(self, options: EncodingOptions) -> dict[str, Any]:
        return _present().recorded_options(options)

    def encoder(self, task: EncodingTask) -> Encoder:
        raise InputError(f"codec {task.settings.kind}: is read, not written; encode with codec block")

    def starting_pack(self, textures: Sequence[SourceTexture], grouping: Grouping, settings: CodecSettings) -> Pack:
        del textures, grouping
        raise InputError(f"codec {settings.kind}: is read, not written; encode with codec block")

    def settings_json(self, settings: CodecSettings) -> dict[str, Any]:
        config = cast(BlockConfig, settings)
        return {"bits_per_texel_of_codes": config.mean_words * 32.0 / config.block_texels}

    def settings_lines(self, settings: CodecSettings) -> list[str]:
        config = cast(BlockConfig, settings)
        side = config.block_side
        *others, last = map(str, config.block_words)
        sizes = f"{', '.join(others)} or {last}" if others else last
        return [
            f"codec block, format 1: blocks of {side}x{side} texels, codes of {sizes} words of 32 bits, "
            f"{config.mean_words * 32.0 / config.block_texels:.2f} bits a texel, "
            f"{config.coefficients} coefficients, {config.modes} modes, {config.multiply_adds} multiply-adds a texel at most"
        ]


CODEC = FirstBlockCodec()
