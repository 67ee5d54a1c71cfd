"""Codec `grid` in torch, in float32: decoders and adapters as stacks, positional encoding, decoding (docs/reference/codec-grid.md)."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ntc.codec.config import LARGEST_HALF, WrapMode
from ntc.codec.grid.model import LOD_INPUT_SCALE, Adapter, GridConfig, GridDecoder, GridTexture, grid_parts
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.reference import image_of_texels
from ntc.codec.torch_texels import PyramidTable, TorchTexels, trilinear_corners

Layer = tuple[Tensor, Tensor]
"""(weight [T, inputs, outputs], bias [T, 1, outputs]): row t computes x @ weight[t] + bias[t]."""


def _as_halves(numbers: Tensor) -> NDArray[np.float32]:
    """Round `numbers` to halves, clamped to their range: a pack must not hold infinity."""
    halves = numbers.detach().cpu().clamp(-LARGEST_HALF, LARGEST_HALF).half()
    return np.asarray(halves.float().numpy(), np.float32)


class AdapterStack(nn.Module):
    """Adapters of `count` textures while they are trained: `scales[l]` and `biases[l]` [count, hidden_width] for hidden layer l.

    With `adapter_output`, `output` is the difference from the decoder's output layer: the two are added, so that the textures of a
    group train a common part together.
    """

    def __init__(self, config: GridConfig, count: int) -> None:
        super().__init__()
        hidden = range(len(config.layer_shapes) - 1)
        self.scales = nn.ParameterList(nn.Parameter(torch.ones(count, config.hidden_width)) for _ in hidden)
        self.biases = nn.ParameterList(nn.Parameter(torch.zeros(count, config.hidden_width)) for _ in hidden)
        outputs, inputs = config.layer_shapes[-1]
        shapes = ((count, outputs, inputs), (count, outputs)) if config.adapter_output else ()
        self.output = nn.ParameterList(nn.Parameter(torch.zeros(shape)) for shape in shapes)
        """Weight [count, outputs, inputs] and bias [count, outputs], or nothing."""

    def load(self, adapters: Sequence[Adapter]) -> None:
        """Copy the adapters of a pack. If they hold an output layer, the decoders' must be 0."""
        for index, adapter in enumerate(adapters):
            self.set(index, adapter)

    def set(self, index: int, adapter: Adapter) -> None:
        """Copy one adapter of a pack."""
        with torch.no_grad():
            for layer in range(len(self.scales)):
                self.scales[layer][index] = torch.from_numpy(adapter.scales[layer].copy())
                self.biases[layer][index] = torch.from_numpy(adapter.biases[layer].copy())
            for parameter, stored in zip(self.output, (adapter.output_weight, adapter.output_bias), strict=False):
                if stored is not None:
                    parameter[index] = torch.from_numpy(stored.copy())

    def export(self, decoders: "DecoderStack", decoder: Tensor) -> tuple[Adapter, ...]:
        """Return the adapters as numpy arrays, rounded to half precision; row t specialises decoder `decoder`[t]."""
        parts = [torch.stack(list(values), dim=1) for values in (self.scales, self.biases)]
        if self.output:
            shared = (decoders.weights[-1], decoders.biases[-1])
            parts += [difference + common[decoder] for difference, common in zip(self.output, shared, strict=True)]
        stacked = [_as_halves(part) for part in parts]
        return tuple(Adapter(*(values.copy() for values in row)) for row in zip(*stacked, strict=True))


class DecoderStack(nn.Module):
    """`count` decoders while they are trained. Layer l has `weights[l]` [count, outputs, inputs] and `biases[l]` [count, outputs]."""

    def __init__(self, config: GridConfig, count: int, generator: torch.Generator) -> None:
        super().__init__()
        self.leaky_slope = config.leaky_slope
        self._in_half = config.weight_bits == 16
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        gain = math.sqrt(2.0 / (1.0 + config.leaky_slope**2))
        for index, (outputs, inputs) in enumerate(config.layer_shapes):
            last = index + 1 == len(config.layer_shapes)
            # Kaiming initialisation for the LeakyReLU layers. The output layer is linear and starts near mid-grey.
            deviation = (1.0 if last else gain) / math.sqrt(inputs)
            weight = torch.randn(count, outputs, inputs, generator=generator) * deviation
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(torch.full((count, outputs), 0.5 if last else 0.0)))

    def layers(
        self, decoder: Tensor, adapters: AdapterStack | None = None, textures: Tensor | None = None
    ) -> list[Layer]:
        """Return the layers for row t of a batch: those of decoder `decoder`[t], specialised by adapter `textures`[t] (None: adapter
        t)."""
        of_textures: Callable[[Tensor], Tensor] = (
            (lambda rows: rows) if textures is None else (lambda rows: rows[textures])
        )
        choice = nn.functional.one_hot(decoder, len(self.weights[0])).to(self.weights[0].dtype)
        layers: list[Layer] = []
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            # A product with a one-hot matrix: its gradient is a product too, many times faster than that of index_select.
            chosen = (choice @ weight.flatten(1)).view(-1, *weight.shape[1:])
            offset = choice @ bias
            if adapters is not None and index + 1 < len(self.weights):
                # Scale the rows of the small matrix instead of its many outputs.
                chosen = chosen * of_textures(adapters.scales[index]).unsqueeze(2)
                offset = of_textures(adapters.biases[index])
            elif adapters is not None and adapters.output:
                chosen, offset = chosen + of_textures(adapters.output[0]), offset + of_textures(adapters.output[1])
            layers.append((chosen.transpose(1, 2), offset.unsqueeze(1)))
        return layers

    def forward(self, inputs: Tensor, decoder: Tensor, adapters: AdapterStack | None = None) -> Tensor:
        """Run the network: [T, N, outputs], not clamped, for `inputs` [T, N, decoder_inputs].

        Row t goes through decoder `decoder`[t], specialised by adapter t.
        """
        values = inputs
        layers = self.layers(decoder, adapters)
        for index, (weight, bias) in enumerate(layers):
            values = torch.baddbmm(bias, values, weight)
            if index + 1 < len(layers):
                values = nn.functional.leaky_relu(values, self.leaky_slope)
        return values

    def load(self, decoders: tuple[GridDecoder, ...]) -> None:
        """Copy the weights of a pack."""
        for index, decoder in enumerate(decoders):
            self.set(index, decoder)

    def set(self, index: int, decoder: GridDecoder) -> None:
        """Copy the weights of one decoder of a pack."""
        with torch.no_grad():
            for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
                weight[index] = torch.from_numpy(decoder.weights[layer].copy())
                bias[index] = torch.from_numpy(decoder.biases[layer].copy())

    def clear_output(self) -> None:
        """Set the output layers to 0, for adapters of a pack, whose output layers are complete."""
        with torch.no_grad():
            self.weights[-1].zero_()
            self.biases[-1].zero_()

    def export(self) -> tuple[GridDecoder, ...]:
        """Return the decoders as numpy arrays, rounded to the precision that the codec stores."""

        def stored(values: Tensor) -> NDArray[np.float32]:
            return _as_halves(values) if self._in_half else np.asarray(values.detach().cpu().numpy(), np.float32)

        weights = [stored(weight) for weight in self.weights]
        biases = [stored(bias) for bias in self.biases]
        return tuple(
            GridDecoder(tuple(weight[index].copy() for weight in weights), tuple(bias[index].copy() for bias in biases))
            for index in range(len(weights[0]))
        )


def level_waves(table: PyramidTable, texture: Tensor, uv: Tensor, level: Tensor, octaves: int) -> Tensor:
    """Return [N, 4 octaves] triangle waves of the texel coordinate at integer `level` [N]. `table` holds texel sizes."""
    size = torch.stack([table.width[texture, level], table.height[texture, level]], dim=-1)
    texel = (uv * size)[:, :, None, None]
    octave = 2.0 ** -torch.arange(1, octaves + 1, device=uv.device, dtype=uv.dtype)[None, None, :, None]
    phase = torch.tensor([0.0, 0.25], device=uv.device, dtype=uv.dtype)[None, None, None, :]
    turns = texel * octave + phase
    return (4.0 * torch.abs(turns - torch.floor(turns) - 0.5) - 1.0).flatten(1)


def positional_encoding(table: PyramidTable, texture: Tensor, uv: Tensor, lod: Tensor, octaves: int) -> Tensor:
    """Return [N, 4 octaves] triangle waves, blended between the two levels around `lod` [N]."""
    lower = torch.floor(lod).long()
    upper = torch.minimum(lower + 1, table.levels[texture] - 1)
    share = (lod - lower)[:, None]
    waves = [level_waves(table, texture, uv, level, octaves) for level in (lower, upper)]
    return waves[0] * (1.0 - share) + waves[1] * share


def with_lod(waves: Tensor, lod: Tensor, config: GridConfig) -> Tensor:
    """Return [N, rest]: the positional encoding `waves`, and `lod` [N] scaled if the codec has a lod input."""
    return torch.cat([waves, lod[:, None] * LOD_INPUT_SCALE], dim=-1) if config.lod_inputs else waves


class TorchGrid(TorchTexels):
    """Decoder of one pack on one torch device. Data of a texture stay on the device after its first decode."""

    texels_at_once = 1 << 17

    def __init__(
        self,
        pack: Pack,
        device: str | torch.device,
        interruption: Callable[[], None] = lambda: None,
    ) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        super().__init__(pack, device, interruption)
        parts = grid_parts(pack)
        self._config, self._textures = parts.config, parts.textures
        self._decoders = DecoderStack(parts.config, len(pack.decoders), torch.Generator().manual_seed(0))
        self._decoders.load(parts.decoders)
        if parts.config.adapter_output:
            self._decoders.clear_output()
        self._decoders.to(self._device)
        self._adapters = [self._adapter(texture) for texture in parts.textures]
        self._tables: dict[tuple[int, tuple[bool, bool]], tuple[PyramidTable, PyramidTable]] = {}
        self._latents: dict[int, tuple[Tensor, Tensor, Tensor]] = {}

    def _adapter(self, texture: GridTexture) -> AdapterStack | None:
        if texture.adapter is None:
            return None
        stack = AdapterStack(self._config, 1)
        stack.load([texture.adapter])
        return stack.to(self._device)

    def _tables_of(self, index: int, wrap: tuple[WrapMode, WrapMode]) -> tuple[PyramidTable, PyramidTable]:
        """Return the sizes and offsets of all levels of a texture, in cells and in texels."""
        repeats = (wrap[0] == "repeat", wrap[1] == "repeat")
        if (index, repeats) not in self._tables:
            texture = self._textures[index]
            levels = texture_levels(texture, self._config)
            sizes = (
                [(level.width, level.height) for level in levels],
                [(level.texel_width, level.texel_height) for level in levels],
            )
            cells, texels = (PyramidTable.of([each], [repeats], self._device) for each in sizes)
            self._tables[index, repeats] = cells, texels
        return self._tables[index, repeats]

    def _latents_of(self, index: int) -> tuple[Tensor, Tensor, Tensor]:
        """Return (stored latents [cells, channels], scale [channels], offset [channels]) of a texture."""
        if index not in self._latents:
            texture = self._textures[index]
            latents, scale, offset = (
                torch.from_numpy(part.copy()).to(self._device)
                for part in (texture.latents, texture.scale, texture.offset)
            )
            self._latents[index] = latents, scale, offset
        return self._latents[index]

    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        texture, config = self._textures[texture_index], self._config
        cells, texels = self._tables_of(texture_index, wrap)
        stored, scale, offset = self._latents_of(texture_index)
        group = torch.tensor([texture.group], device=self._device)

        def decode(same: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
            index, weights = trilinear_corners(cells, same, uv, lod)
            latents = offset + scale * (stored[index] * weights[..., None].float()).sum(1)
            waves = positional_encoding(texels, same, uv, lod, config.positional_octaves).float()
            inputs = torch.cat([latents, with_lod(waves, lod.float(), config)], dim=-1)
            colors: Tensor = self._decoders(inputs[None], group, self._adapters[texture_index])[0]
            return colors

        return decode

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """Return mip `level` decoded at its texel centres, [h, w, channels] uint8 in the texture's colour space."""
        return image_of_texels(self._pack, texture_index, level, self.decode_texels)
