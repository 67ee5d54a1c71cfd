"""Codec `block`: codes of texel blocks under a linear transform that a group shares (docs/reference/codecs.md)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block import storage
from ntc.codec.block import tensors as files
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.rate import bits_of_words, settings_for_target, words_of_bits
from ntc.codec.block.gpu import BlockTables
from ntc.codec.block.model import BlockDecoder, BlockTexture, block_parts
from ntc.codec.block.reference import decode_alpha, decode_mip, lookup_values
from ntc.codec.block.start import mean_colour_pack
from ntc.codec.block.universal import MOST_SCALED_GROUPS, VERSION, set_tables_path, tables_path
from ntc.codec.codec import Codec, Tensors, TensorShape, TextureBytes, TorchTwin
from ntc.codec.config import UNIVERSAL, Precision, WrapMode
from ntc.codec.encoding import (
    DEFAULT_BITS,
    DEFAULT_SET_BITS,
    BitsTarget,
    Encoder,
    EncodingChoices,
    EncodingOptions,
    EncodingTask,
    QualityTarget,
    SizeTarget,
    TextureSet,
)
from ntc.codec.gpu import GpuTables
from ntc.codec.maps import BASE_ALONE, MapName, is_material
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

PREVIEW_SIDE: Final = 128
"""Texels along one side of the textures that the window shows first."""
DEFAULT_TARGET: Final = BitsTarget(DEFAULT_BITS)
SHIPPED_LINE: Final = (
    "tables that ship with the program, version {version}: each group stores gains alone. At equal bits, beside tables of their own, "
    "unseen materials gain 0.6 to 3.3 dB at 256x256 texels, 0 to 0.8 dB at 512x512, and lose 0.3 to 1.1 dB at 1024x1024"
)


def _range_of_bits(config: BlockConfig, size: tuple[int, int]) -> tuple[float, float]:
    """Return the least and most bits per texel of mip 0 that codes of a texture of `size` can take."""
    low, high = (bits_of_words(config.block_words[place], size, config) for place in (0, -1))
    return low, high


class BlockCodec(Codec):
    """Encoded in closed form, decoded in single precision."""

    settings_type = BlockConfig
    trains = False
    added_fields = frozenset({"maps", "tables"})
    default_target = DEFAULT_TARGET
    default_maps = "all"
    psnr_title = "PSNR of mip 0"
    shipped = MappingProxyType({"version": VERSION})
    uncertified = "certified bounds of the error: for codec grid alone; codec block decodes in fp32 at every precision"
    table_text = "bases and bit allocations"

    def target_of(self, maps: Sequence[MapName]) -> BitsTarget:
        return BitsTarget(DEFAULT_SET_BITS) if is_material(maps) else DEFAULT_TARGET

    def former_format(self, fields: Mapping[str, Any]) -> int | None:
        # Files of format 1 do not say so.
        return 1 if fields.get("format", 1) == 1 else None

    def texture_shapes(self, settings: CodecSettings, width: int, height: int) -> dict[str, TensorShape]:
        del width, height
        return storage.texture_shapes(cast(BlockConfig, settings))

    def decoder_shapes(self, settings: CodecSettings) -> dict[str, TensorShape]:
        return files.decoder_shapes(cast(BlockConfig, settings))

    def texture_tensors(self, texture: EncodedTexture, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return storage.texture_tensors(cast(BlockTexture, texture), cast(BlockConfig, settings))

    def decoder_tensors(self, decoder: Decoder, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return files.decoder_tensors(cast(BlockDecoder, decoder), cast(BlockConfig, settings))

    def read_texture(self, tensors: Tensors, known: Mapping[str, Any], settings: CodecSettings) -> EncodedTexture:
        return storage.read_texture(tensors, known, cast(BlockConfig, settings))

    def read_decoder(self, tensors: Tensors, settings: CodecSettings) -> Decoder:
        return files.read_decoder(tensors, cast(BlockConfig, settings))

    def shipped_decoder(self, decoders: int, parameters: Mapping[str, Any], settings: CodecSettings) -> Decoder:
        return files.shipped_decoder(decoders, parameters, cast(BlockConfig, settings))

    def stored_decoders(self, grouping: str, decoders: int, settings: CodecSettings) -> int:
        whole = cast(BlockConfig, settings).tables is None
        return super().stored_decoders(grouping, decoders, settings) if whole else decoders

    def shipped_groups(self, textures: Sequence[SourceTexture], most: int | None = None) -> tuple[int, ...]:
        if all(texture.maps == BASE_ALONE for texture in textures) or most == 1:
            return super().shipped_groups(textures)
        most = min(most or MOST_SCALED_GROUPS, MOST_SCALED_GROUPS)
        if len(textures) <= most:
            return tuple(range(len(textures)))
        from ntc.codec.block.encoding.gains import shared_gains

        return shared_gains(textures, most)

    def texture_bytes(self, texture: EncodedTexture, settings: CodecSettings) -> TextureBytes:
        block_texture, config = cast(BlockTexture, texture), cast(BlockConfig, settings)
        return TextureBytes(block_texture.words.nbytes, block_texture.mean.nbytes + 4 * config.axis_numbers)

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
        parts = block_parts(pack)
        texture = parts.textures[texture_index]
        return lookup_values(texture, parts.decoders[texture.group], parts.config, uv, lod, wrap)

    def reference_mip(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.float64]:
        parts = block_parts(pack)
        texture = parts.textures[texture_index]
        image = decode_mip(texture, parts.decoders[texture.group], parts.config, level)
        return image[..., texture.places(parts.config)]

    def libntc_tables(self, pack: Pack) -> bytes:
        config = cast(BlockConfig, pack.config)
        if pack.grouping.name != UNIVERSAL:
            return b""
        if config.tables is not None:
            return set_tables_path(config.tables).read_bytes()
        return tables_path(int(pack.grouping.parameters["version"]), config.output_channels).read_bytes()

    def coverage_image(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.uint8] | None:
        parts = block_parts(pack)
        texture = parts.textures[texture_index]
        return decode_alpha(texture, parts.decoders[texture.group], parts.config, level)

    def torch_twin(
        self,
        pack: Pack,
        device: str,
        interruption: Callable[[], None] = lambda: None,
    ) -> TorchTwin:
        from ntc.codec.block.torch_twin import TorchBlock

        return TorchBlock(pack, device, interruption)

    def gpu_tables(self, settings: CodecSettings, precision: Precision = "fp32") -> GpuTables:
        del precision
        return BlockTables(cast(BlockConfig, settings))

    def refusals(self, choices: EncodingChoices) -> list[str]:
        default = EncodingChoices()
        given = {
            "steps": choices.steps,
            "epochs": choices.epochs,
            "state": choices.state,
            "device": choices.device if choices.device == "cuda" else None,
            "recipe": None if choices.recipe == default.recipe else choices.recipe,
        }
        return [
            f"--{name} {value}: codec block is not trained; leave it out, or use --codec grid"
            for name, value in given.items()
            if value is not None
        ]

    def settings_for(self, textures: TextureSet, choices: EncodingChoices) -> CodecSettings:
        return settings_for_target(textures, choices.target or self.target_of(textures.maps))

    def options_for(self, choices: EncodingChoices) -> BlockOptions:
        target = choices.target
        return BlockOptions(
            choices.seed,
            quality_db=target.psnr_db if isinstance(target, QualityTarget) else None,
            weights=target.worth if isinstance(target, SizeTarget) else None,
        )

    def live_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return replace(self.options_for(choices), groups_apart=True, preview_side=PREVIEW_SIDE)

    def job_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return BlockOptions(choices.seed, threads=1)

    def texture_bits(self, settings: CodecSettings, size: tuple[int, int]) -> tuple[float, float] | None:
        return _range_of_bits(cast(BlockConfig, settings), size)

    def reencoding_options(self, pack: Pack, texture: int, bits: float) -> EncodingOptions:
        encoded, config = pack.textures[texture], cast(BlockConfig, pack.config)
        size = (encoded.width, encoded.height)
        low, high = _range_of_bits(config, size)
        # Typed bits have few digits.
        if not low - 0.01 <= bits <= high + 0.01:
            raise InputError(
                f"bits {bits:g}: codes of this pack take {low:.2f} to {high:.2f} bits per texel; encode the scene again for others"
            )
        return BlockOptions(texture_words=((texture, words_of_bits(min(max(bits, low), high), size, config)),))

    def recorded_options(self, options: EncodingOptions) -> dict[str, Any]:
        return {"seed": options.seed}

    def encoder(self, task: EncodingTask) -> Encoder:
        from ntc.codec.block.encoding.stages import BlockEncoder

        return BlockEncoder(task)

    def encode_with_decoders(self, textures: Sequence[SourceTexture], known: Pack, options: EncodingOptions) -> Pack:
        from ntc.codec.block.encoding.frozen import encode_with_decoders

        parts = block_parts(known)
        return encode_with_decoders(
            textures, parts.decoders, parts.config, known.grouping.name, cast(BlockOptions, options)
        )

    def compiled_functions(self) -> Mapping[Any, tuple[Any, ...]]:
        from ntc.codec import compiled_maps
        from ntc.codec.block.encoding import compiled_edges, compiled_modes, compiled_texels, compiled_trellis

        modules = (compiled_texels, compiled_modes, compiled_edges, compiled_trellis, compiled_maps)
        return {function: types for module in modules for function, types in module.SIGNATURES.items()}

    def starting_pack(self, textures: Sequence[SourceTexture], grouping: Grouping, settings: CodecSettings) -> Pack:
        return mean_colour_pack(textures, grouping, cast(BlockConfig, settings))

    def settings_json(self, settings: CodecSettings) -> dict[str, Any]:
        config = cast(BlockConfig, settings)
        return {"bits_per_texel_of_codes": config.mean_words * 32.0 / config.block_texels}

    def settings_lines(self, settings: CodecSettings) -> list[str]:
        config = cast(BlockConfig, settings)
        side = config.block_side
        *others, last = map(str, config.block_words)
        sizes = f"{', '.join(others)} or {last} words" if others else f"{last} word{'s' * (last != '1')}"
        shipped = [] if config.tables is None else [SHIPPED_LINE.format(version=config.tables)]
        return [
            f"codec block: blocks of {side}x{side} texels, codes of {sizes} of 32 bits for {config.mips} mips each, "
            f"{config.coefficients} coefficients, {config.modes} modes, {config.multiply_adds} multiply-adds a texel at most",
            *shipped,
        ]


CODEC = BlockCodec()
