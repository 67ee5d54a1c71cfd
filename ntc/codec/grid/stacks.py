"""Decoders and adapters in torch: those of all groups and textures in stacked tensors."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ntc.codec.config import LARGEST_HALF
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.model import Adapter, GridDecoder

Layer = tuple[Tensor, Tensor]
"""(weight [T, inputs, outputs], bias [T, 1, outputs]): row t computes x @ weight[t] + bias[t]."""


def _as_halves(numbers: Tensor) -> NDArray[np.float32]:
    """What half precision stores of `numbers`; beyond its range would lie infinity, which no pack may hold."""
    halves = numbers.detach().cpu().clamp(-LARGEST_HALF, LARGEST_HALF).half()
    return np.asarray(halves.float().numpy(), np.float32)


class AdapterStack(nn.Module):
    """Adapters of `count` textures: `scales[l]` and `biases[l]` [count, hidden_width] for hidden layer l (docs/reference/codecs.md).

    Where adapters hold an output layer, `output` is what it has besides the output layer of the decoder: both are added,
    so that textures learn together what they share.
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
        """Copy the adapters of a pack, for decoders whose output layer is 0 where adapters have their own."""
        for index, adapter in enumerate(adapters):
            self.set(index, adapter)

    def set(self, index: int, adapter: Adapter) -> None:
        """Copy one adapter of a pack."""
        with torch.no_grad():
            for layer in range(len(self.scales)):
                self.scales[layer][index] = torch.from_numpy(adapter.scales[layer].copy())
                self.biases[layer][index] = torch.from_numpy(adapter.biases[layer].copy())
            for own, stored in zip(self.output, (adapter.output_weight, adapter.output_bias), strict=False):
                if stored is not None:
                    own[index] = torch.from_numpy(stored.copy())

    def export(self, decoders: "DecoderStack", decoder: Tensor) -> tuple[Adapter, ...]:
        """The adapters as numpy arrays, rounded to half precision; row t specialises decoder `decoder`[t]."""
        parts = [torch.stack(list(values), dim=1) for values in (self.scales, self.biases)]
        if self.output:
            shared = (decoders.weights[-1], decoders.biases[-1])
            parts += [own + common[decoder] for own, common in zip(self.output, shared, strict=True)]
        stacked = [_as_halves(part) for part in parts]
        return tuple(Adapter(*(values.copy() for values in row)) for row in zip(*stacked, strict=True))


class DecoderStack(nn.Module):
    """`count` decoders of one shape. Layer l has `weights[l]` [count, outputs, inputs] and `biases[l]` [count, outputs]."""

    def __init__(self, config: GridConfig, count: int, generator: torch.Generator) -> None:
        super().__init__()
        self.leaky_slope = config.leaky_slope
        self._in_half = config.weight_bits == 16
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        gain = math.sqrt(2.0 / (1.0 + config.leaky_slope**2))
        for index, (outputs, inputs) in enumerate(config.layer_shapes):
            last = index + 1 == len(config.layer_shapes)
            # Kaiming for the LeakyReLU layers (reading of the paper); the output layer is linear and starts near mid-grey.
            deviation = (1.0 if last else gain) / math.sqrt(inputs)
            weight = torch.randn(count, outputs, inputs, generator=generator) * deviation
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(torch.full((count, outputs), 0.5 if last else 0.0)))

    def layers(
        self, decoder: Tensor, adapters: AdapterStack | None = None, textures: Tensor | None = None
    ) -> list[Layer]:
        """The layers that row t of a batch goes through: those of decoder `decoder`[t], specialised by adapter `textures`[t],
        or t where that is None."""
        own: Callable[[Tensor], Tensor] = (lambda rows: rows) if textures is None else (lambda rows: rows[textures])
        choice = nn.functional.one_hot(decoder, len(self.weights[0])).to(self.weights[0].dtype)
        found: list[Layer] = []
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            # A product with ones and zeros: its way back is a product too, many times faster than index_select's.
            chosen = (choice @ weight.flatten(1)).view(-1, *weight.shape[1:])
            offset = choice @ bias
            if adapters is not None and index + 1 < len(self.weights):
                # Rows of the small matrix are scaled instead of the many values that it makes.
                chosen = chosen * own(adapters.scales[index]).unsqueeze(2)
                offset = own(adapters.biases[index])
            elif adapters is not None and adapters.output:
                chosen, offset = chosen + own(adapters.output[0]), offset + own(adapters.output[1])
            found.append((chosen.transpose(1, 2), offset.unsqueeze(1)))
        return found

    def forward(self, inputs: Tensor, decoder: Tensor, adapters: AdapterStack | None = None) -> Tensor:
        """[T, N, outputs] for `inputs` [T, N, decoder_inputs], row t decoded by decoder `decoder`[t]; not clamped.

        Row t is specialised by adapter t.
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
        """Set output layers to 0: where adapters have their own, those are the whole of it."""
        with torch.no_grad():
            self.weights[-1].zero_()
            self.biases[-1].zero_()

    def export(self) -> tuple[GridDecoder, ...]:
        """The decoders as numpy arrays, exact in the precision in which the codec stores them."""

        def stored(values: Tensor) -> NDArray[np.float32]:
            return _as_halves(values) if self._in_half else np.asarray(values.detach().cpu().numpy(), np.float32)

        weights = [stored(weight) for weight in self.weights]
        biases = [stored(bias) for bias in self.biases]
        return tuple(
            GridDecoder(tuple(weight[index].copy() for weight in weights), tuple(bias[index].copy() for bias in biases))
            for index in range(len(weights[0]))
        )
