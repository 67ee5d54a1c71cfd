"""Loss and gradients of many small decoders in one go, a piece of the batch at a time (the twin of autograd over
`DecoderStack.forward`, which tests compare it with)."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import torch
from torch import Tensor

from ntc.codec.encoding import Interruption, no_interruption
from ntc.codec.grid.stacks import Layer

ROWS_AT_ONCE_CPU = 2048
"""Rows of a piece: its activations of 64 numbers a row (half a megabyte each) stay in the cache of a core."""
ROWS_AT_ONCE_CUDA = 1 << 20
"""A GPU wants much work at once."""


def _pieces(textures: int, rows: int, most: int) -> Iterator[tuple[slice, slice]]:
    together = max(1, most // rows)
    for first in range(0, textures, together):
        for start in range(0, rows, most):
            yield slice(first, first + together), slice(start, start + most)


class _SquaredError(torch.autograd.Function):
    """Keeps no activations of the whole batch: the way back of a piece is gone right after its way there."""

    @staticmethod
    def forward(
        context: Any,
        latents: Tensor,
        known: Tensor,
        targets: Tensor,
        mask: Tensor,
        slope: float,
        interruption: Interruption,
        *parameters: Tensor,
    ) -> Tensor:
        layers = list(zip(parameters[0::2], parameters[1::2], strict=True))
        gradients = [torch.zeros_like(parameter) for parameter in parameters]
        into_latents = torch.empty_like(latents)
        channels = latents.shape[2]
        losses = latents.new_zeros(len(latents))

        most = ROWS_AT_ONCE_CUDA if latents.is_cuda else ROWS_AT_ONCE_CPU
        for textures, rows in _pieces(latents.shape[0], latents.shape[1], most):
            interruption()
            values = [torch.cat([latents[textures, rows], known[textures, rows]], dim=2)]
            for number, (weight, bias) in enumerate(layers):
                made = torch.baddbmm(bias[textures], values[-1], weight[textures])
                values.append(torch.nn.functional.leaky_relu_(made, slope) if number + 1 < len(layers) else made)
            back = values.pop().sub_(targets[textures, rows]).mul_(mask[textures].unsqueeze(1))
            losses[textures] += back.square().sum(dim=(1, 2))
            back.mul_(2.0 * mask[textures].unsqueeze(1))
            for number in reversed(range(len(layers))):
                weight = layers[number][0][textures]
                # The few columns first: several times faster than the other way round for three outputs.
                gradients[2 * number][textures] += torch.bmm(back.transpose(1, 2), values[number]).transpose(1, 2)
                gradients[2 * number + 1][textures] += back.sum(dim=1, keepdim=True)
                if number == 0:
                    torch.bmm(back, weight[:, :channels].transpose(1, 2), out=into_latents[textures, rows])
                    break
                back = torch.bmm(back, weight.transpose(1, 2))
                torch.ops.aten.leaky_relu_backward.grad_input(back, values[number], slope, True, grad_input=back)

        context.save_for_backward(into_latents, *gradients)
        return losses

    @staticmethod
    def backward(context: Any, *outer: Tensor) -> tuple[Tensor | None, ...]:
        into_latents, *gradients = context.saved_tensors
        # One factor a texture: how its loss counts.
        factor = outer[0][:, None, None]
        latents = into_latents * factor if context.needs_input_grad[0] else None
        return latents, None, None, None, None, None, *(gradient * factor for gradient in gradients)


def squared_error(
    layers: Sequence[Layer],
    slope: float,
    latents: Tensor,
    known: Tensor,
    targets: Tensor,
    mask: Tensor,
    interruption: Interruption = no_interruption,
) -> Tensor:
    """[T]: for each texture the sum of squared differences between decoded values and `targets` [T, N, outputs], each times `mask`.

    Inputs are `latents` [T, N, channels] and `known` [T, N, rest]; `mask` [T, outputs] is 0 for channels that do not count, else the
    square root of what a squared error is worth: 1 where there is one map.
    Differentiable in layers and latents. `interruption` is called before each piece.
    """
    parameters = [tensor for layer in layers for tensor in layer]
    apply: Callable[..., Tensor] = _SquaredError.apply
    return apply(latents, known, targets, mask, slope, interruption, *parameters)
