"""Codec `grid`, the paper's: grids of latents that are blended and decoded by a small network (docs/reference/codec-grid.md)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import (
    SAMPLED_TEXELS,
    CertifiedError,
    ChosenPrecision,
    Codec,
    Tensors,
    TensorShape,
    TextureBytes,
    TorchTwin,
)
from ntc.codec.config import Precision, WrapMode
from ntc.codec.encoding import Encoder, EncodingChoices, EncodingOptions, EncodingTask, TextureSet, given_target
from ntc.codec.gpu import GpuTables
from ntc.codec.grid.accuracy.error_bound import pack_bounds
from ntc.codec.grid.accuracy.precision_choice import chosen_precision, sampled_bound
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.gpu import GridTables
from ntc.codec.grid.model import Adapter, GridConfig, GridDecoder, GridTexture, grid_parts
from ntc.codec.grid.reference import decoder_inputs, run_decoder
from ntc.codec.grid.tensors import grey_pack, packed_cells, unpacked_cells
from ntc.codec.grid.training.config import TrainingConfig, chosen_config, recipe_codec
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture


class GridCodec(Codec):
    """The interface of codec `grid`: trained by gradient descent, decoded in single precision or in halves."""

    settings_type = GridConfig
    trains = True
    psnr_title = "PSNR of the latest samples"
    added_fields = frozenset({"adapters", "adapter_output", "weight_bits", "maps"})

    def texture_shapes(self, settings: CodecSettings, width: int, height: int) -> dict[str, TensorShape]:
        config = cast(GridConfig, settings)
        channels = config.latent_channels
        shapes: dict[str, TensorShape] = {
            "latents.{}": ("U8", (latent_cell_count(width, height, config), config.cell_bytes)),
            "latents.{}.scale": ("F32", (channels,)),
            "latents.{}.offset": ("F32", (channels,)),
        }
        if config.adapters:
            shapes["adapter.{}.scales"] = ("F16", (2, config.hidden_width))
            shapes["adapter.{}.biases"] = ("F16", (2, config.hidden_width))
        if config.adapter_output:
            shapes["adapter.{}.output.weight"] = ("F16", (config.output_channels, config.hidden_width))
            shapes["adapter.{}.output.bias"] = ("F16", (config.output_channels,))
        return shapes

    def decoder_shapes(self, settings: CodecSettings) -> dict[str, TensorShape]:
        config = cast(GridConfig, settings)
        kind, shapes = f"F{config.weight_bits}", dict[str, TensorShape]()
        for layer, (outputs, inputs) in enumerate(config.layer_shapes):
            shapes[f"decoder.{{}}.{layer}.weight"] = (kind, (outputs, inputs))
            shapes[f"decoder.{{}}.{layer}.bias"] = (kind, (outputs,))
        return shapes

    def texture_tensors(self, texture: EncodedTexture, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        grid_texture, config = cast(GridTexture, texture), cast(GridConfig, settings)
        tensors: dict[str, NDArray[Any]] = {
            "latents.{}": packed_cells(grid_texture.latents, config.latent_bits),
            "latents.{}.scale": np.ascontiguousarray(grid_texture.scale),
            "latents.{}.offset": np.ascontiguousarray(grid_texture.offset),
        }
        if grid_texture.adapter is not None:
            tensors["adapter.{}.scales"] = grid_texture.adapter.scales.astype(np.float16)
            tensors["adapter.{}.biases"] = grid_texture.adapter.biases.astype(np.float16)
            if grid_texture.adapter.output_weight is not None and grid_texture.adapter.output_bias is not None:
                tensors["adapter.{}.output.weight"] = grid_texture.adapter.output_weight.astype(np.float16)
                tensors["adapter.{}.output.bias"] = grid_texture.adapter.output_bias.astype(np.float16)
        return tensors

    def decoder_tensors(self, decoder: Decoder, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        grid_decoder = cast(GridDecoder, decoder)
        kind = np.float16 if cast(GridConfig, settings).weight_bits == 16 else np.float32
        tensors: dict[str, NDArray[Any]] = {}
        for layer, (weight, bias) in enumerate(zip(grid_decoder.weights, grid_decoder.biases, strict=True)):
            tensors[f"decoder.{{}}.{layer}.weight"] = np.ascontiguousarray(weight, kind)
            tensors[f"decoder.{{}}.{layer}.bias"] = np.ascontiguousarray(bias, kind)
        return tensors

    def read_texture(self, tensors: Tensors, known: Mapping[str, Any], settings: CodecSettings) -> EncodedTexture:
        config = cast(GridConfig, settings)
        adapter = None
        if config.adapters:
            parts = (
                ("scales", "biases", "output.weight", "output.bias") if config.adapter_output else ("scales", "biases")
            )
            adapter = Adapter(*(tensors[f"adapter.{{}}.{part}"].astype(np.float32) for part in parts))
        return GridTexture(
            **known,
            latents=unpacked_cells(tensors["latents.{}"], config.latent_bits),
            scale=tensors["latents.{}.scale"],
            offset=tensors["latents.{}.offset"],
            adapter=adapter,
        )

    def read_decoder(self, tensors: Tensors, settings: CodecSettings) -> Decoder:
        layers = range(len(cast(GridConfig, settings).layer_shapes))
        weights, biases = (
            tuple(tensors[f"decoder.{{}}.{layer}.{part}"].astype(np.float32) for layer in layers)
            for part in ("weight", "bias")
        )
        return GridDecoder(weights, biases)

    def texture_bytes(self, texture: EncodedTexture, settings: CodecSettings) -> TextureBytes:
        grid_texture, config = cast(GridTexture, texture), cast(GridConfig, settings)
        adapter = 0
        if grid_texture.adapter is not None:
            parts = (
                grid_texture.adapter.scales,
                grid_texture.adapter.biases,
                grid_texture.adapter.output_weight,
                grid_texture.adapter.output_bias,
            )
            # Stored in half precision: two bytes a number.
            adapter = sum(2 * part.size for part in parts if part is not None)
        return TextureBytes(
            len(grid_texture.latents) * config.cell_bytes,
            grid_texture.scale.nbytes + grid_texture.offset.nbytes,
            adapter,
        )

    def decoder_bytes(self, decoder: Decoder, settings: CodecSettings) -> int:
        grid_decoder = cast(GridDecoder, decoder)
        numbers = sum(array.size for array in (*grid_decoder.weights, *grid_decoder.biases))
        return numbers * cast(GridConfig, settings).weight_bits // 8

    def reference_values(
        self,
        pack: Pack,
        texture_index: int,
        uv: NDArray[np.float64],
        lod: NDArray[np.float64],
        wrap: tuple[WrapMode, WrapMode],
    ) -> NDArray[np.float64]:
        parts = grid_parts(pack)
        texture = parts.textures[texture_index]
        inputs = decoder_inputs(pack, texture, uv, lod, wrap)
        return run_decoder(parts.decoders[texture.group], inputs, parts.config.leaky_slope, texture.adapter)

    def libntc_tables(self, pack: Pack) -> bytes:
        del pack
        return b""

    def torch_twin(
        self,
        pack: Pack,
        device: str,
        interruption: Callable[[], None] = lambda: None,
    ) -> TorchTwin:
        from ntc.codec.grid.torch_twin import TorchGrid

        return TorchGrid(pack, device, interruption)

    def stored_pack(self, pack: Pack, precision: Precision) -> Pack:
        return stored_pack(pack, precision)

    def chosen_precision(self, pack: Pack, fastest_first: Sequence[Precision]) -> ChosenPrecision:
        return chosen_precision(pack, fastest_first)

    def certified_errors(self, pack: Pack) -> Mapping[Precision, CertifiedError]:
        bounds = pack_bounds(pack)
        return {
            precision: CertifiedError(
                bounds[precision].error,
                sampled_bound(pack, precision, SAMPLED_TEXELS),
                max(bounds[precision].activations),
                bounds[precision].overflows,
            )
            for precision in get_args(Precision)
        }

    def gpu_tables(self, settings: CodecSettings, precision: Precision = "fp32") -> GpuTables:
        return GridTables(cast(GridConfig, settings), precision)

    def refusals(self, choices: EncodingChoices) -> list[str]:
        given = given_target(choices.target)
        return [f"--{name} {value}: only --codec block takes it" for name, value in given.items()]

    def settings_for(self, textures: TextureSet, choices: EncodingChoices) -> CodecSettings:
        return recipe_codec(choices.recipe, textures.channels, textures.levels, textures.maps)

    def options_for(self, choices: EncodingChoices) -> EncodingOptions:
        return chosen_config(choices)

    def recorded_options(self, options: EncodingOptions) -> dict[str, Any]:
        return asdict(cast(TrainingConfig, options))

    def encoder(self, task: EncodingTask) -> Encoder:
        from ntc.codec.grid.training.encoder import GridEncoder

        return GridEncoder(task)

    def starting_pack(self, textures: Sequence[SourceTexture], grouping: Grouping, settings: CodecSettings) -> Pack:
        return grey_pack(textures, grouping, cast(GridConfig, settings))

    def decoder_text(self, settings: CodecSettings) -> str:
        config = cast(GridConfig, settings)
        return " " + "-".join(str(side) for side in (config.decoder_inputs, *(rows for rows, _ in config.layer_shapes)))


CODEC = GridCodec()
