"""Decoders in torch: the weights of all decoders of a pack in stacked tensors."""

import math

import torch
from torch import Tensor, nn

from ntc.config import CodecConfig
from ntc.pack import Decoder


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

    def forward(self, inputs: Tensor, decoder: Tensor) -> Tensor:
        """[T, N, outputs] for `inputs` [T, N, decoder_inputs], row t decoded by decoder `decoder`[t]; not clamped."""
        values = inputs
        choice = nn.functional.one_hot(decoder, len(self.weights[0])).to(inputs.dtype)
        last = len(self.weights) - 1
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            # A product with ones and zeros: its way back is a product too, many times faster than index_select's.
            chosen = (choice @ weight.flatten(1)).view(-1, *weight.shape[1:]).transpose(1, 2)
            values = torch.baddbmm((choice @ bias).unsqueeze(1), values, chosen)
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
