"""Codec `two_colors`: blocks of 4x4 texels between two colours, at 6 bits a texel of each plane of maps."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import Codec, Tensors, TensorShape, TextureBytes, TorchTwin, texture_fields
from ntc.codec.config import Precision, WrapMode
from ntc.codec.encoding import Encoder, EncodingChoices, EncodingOptions, EncodingTask, TextureSet, given_target
from ntc.codec.gpu import GpuTables
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture
from tests.support.two_colors.encoder import TwoColorsEncoder
from tests.support.two_colors.gpu import TwoColorsTables
from tests.support.two_colors.model import TwoColorsConfig, TwoColorsOptions, TwoColorsTexture
from tests.support.two_colors.reference import decode_image, lookup_values


class TwoColorsCodec(Codec):
    """Codec that encodes block by block; the textures of a group share nothing."""

    settings_type = TwoColorsConfig
    trains = False
    default_maps = "all"
    psnr_title = "PSNR of mip 0"

    def texture_shapes(self, settings: CodecSettings, width: int, height: int) -> dict[str, TensorShape]:
        two_colors = cast(TwoColorsConfig, settings)
        return {"latents.{}": ("U8", (latent_cell_count(width, height, two_colors), two_colors.block_bytes))}

    def decoder_shapes(self, settings: CodecSettings) -> dict[str, TensorShape]:
        return {}

    def texture_tensors(self, texture: EncodedTexture, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return {"latents.{}": np.ascontiguousarray(cast(TwoColorsTexture, texture).blocks)}

    def decoder_tensors(self, decoder: Decoder, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        return {}

    def read_texture(self, tensors: Tensors, known: Mapping[str, Any], settings: CodecSettings) -> EncodedTexture:
        return TwoColorsTexture(**known, blocks=tensors["latents.{}"])

    def read_decoder(self, tensors: Tensors, settings: CodecSettings) -> Decoder:
        return Decoder()

    def texture_bytes(self, texture: EncodedTexture, settings: CodecSettings) -> TextureBytes:
        return TextureBytes(cast(TwoColorsTexture, texture).blocks.nbytes, 0)

    def decoder_bytes(self, decoder: Decoder, settings: CodecSettings) -> int:
        return 0

    def reference_values(
        self,
        pack: Pack,
        texture_index: int,
        uv: NDArray[np.float64],
        lod: NDArray[np.float64],
        wrap: tuple[WrapMode, WrapMode],
    ) -> NDArray[np.float64]:
        texture = cast(TwoColorsTexture, pack.textures[texture_index])
        return lookup_values(texture, cast(TwoColorsConfig, pack.config), uv, lod, wrap)

    def reference_mip(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.float64]:
        texture = cast(TwoColorsTexture, pack.textures[texture_index])
        return decode_image(texture, cast(TwoColorsConfig, pack.config), level) / 255.0

    def torch_twin(self, pack: Pack, device: str, interruption: Callable[[], None] = lambda: None) -> TorchTwin:
        from tests.support.two_colors.torch_twin import TorchTwoColors

        return TorchTwoColors(pack, device, interruption)

    def gpu_tables(self, settings: CodecSettings, precision: Precision = "fp32") -> GpuTables:
        return TwoColorsTables(cast(TwoColorsConfig, settings))

    def refusals(self, choices: EncodingChoices) -> list[str]:
        default = EncodingChoices()
        given: dict[str, Any] = {
            **given_target(choices.target),
            "steps": choices.steps,
            "epochs": choices.epochs,
            "state": choices.state,
            "device": choices.device if choices.device == "cuda" else None,
            "recipe": None if choices.recipe == default.recipe else choices.recipe,
        }
        return [
            f"--{name} {value}: codec two_colors always takes 6 bits a texel, and is not trained; leave it out"
            for name, value in given.items()
            if value is not None
        ]

    def settings_for(self, textures: TextureSet, choices: EncodingChoices) -> CodecSettings:
        return TwoColorsConfig(textures.channels, textures.maps, textures.levels)

    def options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return TwoColorsOptions(choices.seed)

    def recorded_options(self, options: EncodingOptions) -> dict[str, Any]:
        return {}

    def encoder(self, task: EncodingTask) -> Encoder:
        return TwoColorsEncoder(task)

    def starting_pack(self, textures: Sequence[SourceTexture], grouping: Grouping, settings: CodecSettings) -> Pack:
        config = cast(TwoColorsConfig, settings)
        encoded = tuple(
            TwoColorsTexture(
                **texture_fields(source, group),
                blocks=np.full((latent_cell_count(*source.size, config), config.block_bytes), 128, np.uint8),
            )
            for source, group in zip(textures, grouping.groups, strict=True)
        )
        return Pack(settings, grouping, encoded, (Decoder(),) * grouping.group_count)


CODEC = TwoColorsCodec()
