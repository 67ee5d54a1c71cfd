"""Decoders in torch: the weights of all decoders of a pack in stacked tensors."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from ntc.config import CodecConfig
from ntc.pack import Adapter, Decoder


class AdapterStack(nn.Module):
    """Adapters of `count` textures: `scales[l]` and `biases[l]` [count, hidden_width] for hidden layer l (docs/codec.md)."""

    def __init__(self, config: CodecConfig, count: int) -> None:
        super().__init__()
        hidden = range(len(config.layer_shapes) - 1)
        self.scales = nn.ParameterList(nn.Parameter(torch.ones(count, config.hidden_width)) for _ in hidden)
        self.biases = nn.ParameterList(nn.Parameter(torch.zeros(count, config.hidden_width)) for _ in hidden)

    def load(self, adapters: Sequence[Adapter]) -> None:
        """Take over the adapters of a pack."""
        with torch.no_grad():
            for index, adapter in enumerate(adapters):
                for layer in range(len(self.scales)):
                    self.scales[layer][index] = torch.from_numpy(adapter.scales[layer].copy())
                    self.biases[layer][index] = torch.from_numpy(adapter.biases[layer].copy())

    def export(self) -> tuple[Adapter, ...]:
        """The adapters as numpy arrays, rounded to half precision."""
        stacked = [
            torch.stack(list(values), dim=1).detach().cpu().half().float().numpy()
            for values in (self.scales, self.biases)
        ]
        return tuple(Adapter(scales.copy(), biases.copy()) for scales, biases in zip(*stacked, strict=True))


class DecoderStack(nn.Module):
    """`count` decoders of one shape. Layer l has `weights[l]` [count, outputs, inputs] and `biases[l]` [count, outputs]."""

    def __init__(self, config: CodecConfig, count: int, generator: torch.Generator) -> None:
        super().__init__()
        self.leaky_slope = config.leaky_slope
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

    def forward(self, inputs: Tensor, decoder: Tensor, adapters: "AdapterStack | None" = None) -> Tensor:
        """[T, N, outputs] for `inputs` [T, N, decoder_inputs], row t decoded by decoder `decoder`[t]; not clamped.

        Row t is specialised by adapter t.
        """
        values = inputs
        choice = nn.functional.one_hot(decoder, len(self.weights[0])).to(inputs.dtype)
        last = len(self.weights) - 1
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            # A product with ones and zeros: its way back is a product too, many times faster than index_select's.
            chosen = (choice @ weight.flatten(1)).view(-1, *weight.shape[1:]).transpose(1, 2)
            offset = (choice @ bias).unsqueeze(1)
            if adapters is not None and index < last:
                # Columns of the small matrix are scaled instead of the many values that it makes.
                chosen = chosen * adapters.scales[index].unsqueeze(1)
                offset = adapters.biases[index].unsqueeze(1)
            values = torch.baddbmm(offset, values, chosen)
            if index < last:
                values = nn.functional.leaky_relu(values, self.leaky_slope)
        return values

    def load(self, decoders: tuple[Decoder, ...]) -> None:
        """Take over the weights of a pack."""
        with torch.no_grad():
            for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
                for index, decoder in enumerate(decoders):
                    weight[index] = torch.from_numpy(decoder.weights[layer].copy())
                    bias[index] = torch.from_numpy(decoder.biases[layer].copy())

    def export(self) -> tuple[Decoder, ...]:
        """The decoders as numpy arrays."""
        weights = [weight.detach().cpu().numpy() for weight in self.weights]
        biases = [bias.detach().cpu().numpy() for bias in self.biases]
        return tuple(
            Decoder(tuple(weight[index].copy() for weight in weights), tuple(bias[index].copy() for bias in biases))
            for index in range(len(weights[0]))
        )
