"""Loss, gradients and optimisers of a training."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from ntc.codec.encoding import Interruption, no_interruption
from ntc.codec.grid.torch_twin import AdapterStack, DecoderStack, Layer
from ntc.codec.grid.training.config import TrainingConfig

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
    """Return [T]: for each texture the sum of squared differences between decoded values and `targets` [T, N, outputs], each times
    `mask`.

    Inputs are `latents` [T, N, channels] and `known` [T, N, rest]; `mask` [T, outputs] is 0 for channels that do not count, else the
    square root of what a squared error is worth: 1 where there is one map.
    Differentiable in layers and latents. `interruption` is called before each piece.
    """
    parameters = [tensor for layer in layers for tensor in layer]
    apply: Callable[..., Tensor] = _SquaredError.apply
    return apply(latents, known, targets, mask, slope, interruption, *parameters)


MOMENTUM = 0.95
ROUNDS = 5
QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients of the iteration that carries all singular values towards 1 (op. cit.)."""
STEP_LIKE_ADAM = 0.2
"""Root mean square of a step's entries, about that of Adam's, so that learning rates are comparable (J. Liu et al., 2025)."""
SMALLEST = 1e-12


def orthogonalised(matrices: Tensor) -> Tensor:
    """Return [count, rows, columns]: each matrix with its singular values carried near 1, by a Newton-Schulz iteration."""
    a, b, c = QUINTIC
    values: Tensor = matrices / (matrices.norm(dim=(1, 2), keepdim=True) + SMALLEST)
    tall = values.shape[1] > values.shape[2]
    if tall:
        values = values.transpose(1, 2)
    for _ in range(ROUNDS):
        square = values @ values.transpose(1, 2)
        values = a * values + (b * square + c * square @ square) @ values
    return values.transpose(1, 2) if tall else values


class OptimizerPart(ABC):
    """Parameters that are trained alike, and the optimiser that moves them.

    It is none of `torch.optim`, because each of those imports torch's compiler, which imports triton. Triton and Mesa both carry LLVM,
    and a process that has an OpenGL context of Mesa crashes when it loads triton.
    """

    def __init__(self, name: str, parameters: Iterable[Tensor], rate: float, freezes: bool = False) -> None:
        """`rate` is the learning rate before any schedule. `freezes`: freezing slows it down, as it does for decoders, which the
        textures of a group share."""
        self.name, self.parameters, self.rate, self.freezes = name, list(parameters), rate, freezes
        self._states: list[dict[str, Tensor]] = [{} for _ in self.parameters]

    @torch.no_grad()
    def step(self, scale: float) -> None:
        """One step at `scale` times the rate; none at 0, where Adam would still move by its momentum."""
        if scale <= 0.0:
            return
        for parameter, state in zip(self.parameters, self._states, strict=True):
            if parameter.grad is not None:
                self._move(parameter, parameter.grad, state, self.rate * scale)

    @abstractmethod
    def _move(self, parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], rate: float) -> None:
        """Move a parameter against its gradient, in place; `state` is empty before the first step."""

    def clear_gradients(self) -> None:
        """Forget the gradients of the last step."""
        for parameter in self.parameters:
            parameter.grad = None

    def state(self) -> dict[str, Tensor]:
        """Parameters and their optimiser state, by name; not copies."""
        found: dict[str, Tensor] = {}
        for number, (parameter, state) in enumerate(zip(self.parameters, self._states, strict=True)):
            found[f"{self.name}.{number}"] = parameter.detach()
            found.update({f"{self.name}.{number}.{key}": value for key, value in state.items()})
        return found

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Copy a state. Raises KeyError for a missing parameter and ValueError for another shape."""
        self._states = [{} for _ in self.parameters]
        for number, parameter in enumerate(self.parameters):
            name = f"{self.name}.{number}"
            values = state[name]
            if values.shape != parameter.shape:
                raise ValueError(f"{name} is {list(values.shape)}, expected {list(parameter.shape)}")
            with torch.no_grad():
                parameter.copy_(values)
            remembered = {
                key.removeprefix(f"{name}."): value for key, value in state.items() if key.startswith(f"{name}.")
            }
            for key, value in remembered.items():
                if value.numel() > 1 and value.shape != parameter.shape:
                    raise ValueError(f"{name}.{key} is {list(value.shape)}, expected {list(parameter.shape)}")
                self._states[number][key] = value.clone().to(parameter.device)


BETAS = (0.9, 0.999)
EPSILON = 1e-8


class Adam(OptimizerPart):
    """The optimiser Adam (D. Kingma and J. Ba, 2015, algorithm 1), by the operator of torch that moves a tensor in one pass."""

    def _move(self, parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], rate: float) -> None:
        if not state:
            state["step"] = torch.zeros((), device=parameter.device)
            state["exp_avg"] = torch.zeros_like(parameter)
            state["exp_avg_sq"] = torch.zeros_like(parameter)
        state["step"] += 1
        # The operator has no public name outside torch.optim.
        torch.ops.aten._fused_adam_(
            [parameter],
            [gradient],
            [state["exp_avg"]],
            [state["exp_avg_sq"]],
            [],
            [state["step"]],
            lr=rate,
            beta1=BETAS[0],
            beta2=BETAS[1],
            weight_decay=0.0,
            eps=EPSILON,
            amsgrad=False,
            maximize=False,
        )


class Muon(OptimizerPart):
    """The optimiser Muon for parameters of shape [count, rows, columns], each of the `count` matrices by itself."""

    def _move(self, parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], rate: float) -> None:
        if not state:
            state["momentum"] = torch.zeros_like(parameter)
        momentum = state["momentum"].mul_(MOMENTUM).add_(gradient)
        direction = orthogonalised(gradient + MOMENTUM * momentum)
        size = STEP_LIKE_ADAM * max(parameter.shape[1:]) ** 0.5
        parameter.sub_(direction, alpha=size * rate)


def optimizer_parts(
    latents: Tensor, decoders: DecoderStack, adapters: AdapterStack | None, training: TrainingConfig
) -> tuple[OptimizerPart, ...]:
    """Return the optimisers of `training`, that of the latents first."""
    hidden = list(decoders.weights[:-1]) if training.hidden_optimizer == "muon" else []
    others = [p for p in decoders.parameters() if not any(p is matrix for matrix in hidden)]
    rate = training.decoder_rate
    parts: list[OptimizerPart] = [
        Adam("latents", [latents], training.latent_rate),
        Adam("decoders", others, rate, freezes=True),
    ]
    if hidden:
        parts.append(Muon("hidden", hidden, training.hidden_rate, freezes=True))
    if adapters is not None:
        parts.append(Adam("adapters", adapters.parameters(), rate))
    return tuple(parts)
