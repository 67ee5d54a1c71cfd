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
"""Samples of a piece on a CPU: activations of 64 numbers per sample (half a megabyte per layer) fit into the cache of a core."""
ROWS_AT_ONCE_CUDA = 1 << 20
"""Samples of a piece on a GPU, which needs much work at once."""


def _pieces(textures: int, rows: int, most: int) -> Iterator[tuple[slice, slice]]:
    textures_at_once = max(1, most // rows)
    for first in range(0, textures, textures_at_once):
        for start in range(0, rows, most):
            yield slice(first, first + textures_at_once), slice(start, start + most)


class _SquaredError(torch.autograd.Function):
    """Squared error of the network with hand-written gradients.

    Autograd would store the activations of the whole batch. Here a piece runs forwards and backwards before the next one starts, so
    its activations stay in the cache. Gradients are those of each texture's loss alone; `backward` scales them by the texture's
    weight.
    """

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
                sums = torch.baddbmm(bias[textures], values[-1], weight[textures])
                values.append(torch.nn.functional.leaky_relu_(sums, slope) if number + 1 < len(layers) else sums)
            back = values.pop().sub_(targets[textures, rows]).mul_(mask[textures].unsqueeze(1))
            losses[textures] += back.square().sum(dim=(1, 2))
            back.mul_(2.0 * mask[textures].unsqueeze(1))
            for number in reversed(range(len(layers))):
                weight = layers[number][0][textures]
                # The product with the few columns first is several times faster for three outputs.
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
        # One factor for each texture: the weight of its loss.
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
    """Return [T]: for each texture the sum of (mask * (decoded value - target))^2, differentiable in `layers` and `latents`.

    Inputs are `latents` [T, N, channels] and `known` [T, N, rest]; `targets` are [T, N, outputs]. `mask` [T, outputs] is the square
    root of the weight of a channel: 0 for channels that the texture lacks, 1 for a single map.
    `interruption` is called before each piece.
    """
    parameters = [tensor for layer in layers for tensor in layer]
    apply: Callable[..., Tensor] = _SquaredError.apply
    return apply(latents, known, targets, mask, slope, interruption, *parameters)


MOMENTUM = 0.95
"""Decay of Muon's momentum per step."""
ROUNDS = 5
"""Steps of the Newton-Schulz iteration."""
QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients (a, b, c) of the Newton-Schulz iteration (K. Jordan et al. 2024)."""
STEP_LIKE_ADAM = 0.2
"""Root mean square of the entries of a Muon step, divided by the rate. Adam has about the same, so their rates are comparable
(J. Liu et al. 2025)."""
SMALLEST = 1e-12


def orthogonalised(matrices: Tensor) -> Tensor:
    """Return `matrices` [count, rows, columns] with all singular values moved near 1."""
    # Newton-Schulz iteration. The odd polynomial p(s) = a s + b s^3 + c s^5 maps each singular value s of a matrix X to p(s), because
    # p(X) = a X + (b X X^T + c (X X^T)^2) X has the same singular vectors. The first division brings all s into [0, 1]. Five
    # iterations with these coefficients move them to about [0.7, 1.2], which is close enough, without a decomposition.
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
    """Parameters with one learning rate, and their optimiser.

    The optimisers of `torch.optim` import torch's compiler, and that imports triton. Triton and Mesa both contain LLVM: a process with
    an OpenGL context of Mesa crashes when it loads triton. So they are not used here.
    """

    def __init__(self, name: str, parameters: Iterable[Tensor], rate: float, freezes: bool = False) -> None:
        """Make an optimiser of `parameters`. `rate` is the learning rate without the schedule. `freezes`: gradual freezing scales it,
        as for decoders."""
        self.name, self.parameters, self.rate, self.freezes = name, list(parameters), rate, freezes
        self._states: list[dict[str, Tensor]] = [{} for _ in self.parameters]

    @torch.no_grad()
    def step(self, scale: float) -> None:
        """Do one step at `scale` times the rate. At 0 nothing moves and no state changes."""
        if scale <= 0.0:
            return
        for parameter, state in zip(self.parameters, self._states, strict=True):
            if parameter.grad is not None:
                self._move(parameter, parameter.grad, state, self.rate * scale)

    @abstractmethod
    def _move(self, parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], rate: float) -> None:
        """Move a parameter against its gradient, in place; `state` is empty before the first step."""

    def clear_gradients(self) -> None:
        """Drop the gradients of the last step."""
        for parameter in self.parameters:
            parameter.grad = None

    def state(self) -> dict[str, Tensor]:
        """Return parameters and their optimiser state by name. They are not copies."""
        tensors: dict[str, Tensor] = {}
        for number, (parameter, state) in enumerate(zip(self.parameters, self._states, strict=True)):
            tensors[f"{self.name}.{number}"] = parameter.detach()
            tensors.update({f"{self.name}.{number}.{key}": value for key, value in state.items()})
        return tensors

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state` returned. Raises KeyError for a missing parameter and ValueError for another shape."""
        self._states = [{} for _ in self.parameters]
        for number, parameter in enumerate(self.parameters):
            name = f"{self.name}.{number}"
            values = state[name]
            if values.shape != parameter.shape:
                raise ValueError(f"{name} is {list(values.shape)}, expected {list(parameter.shape)}")
            with torch.no_grad():
                parameter.copy_(values)
            moments = {
                key.removeprefix(f"{name}."): value for key, value in state.items() if key.startswith(f"{name}.")
            }
            for key, value in moments.items():
                if value.numel() > 1 and value.shape != parameter.shape:
                    raise ValueError(f"{name}.{key} is {list(value.shape)}, expected {list(parameter.shape)}")
                self._states[number][key] = value.clone().to(parameter.device)


BETAS = (0.9, 0.999)
"""Adam's decay rates of the means of gradients and of their squares."""
EPSILON = 1e-8


class Adam(OptimizerPart):
    """The optimiser Adam (D. Kingma and J. Ba 2015, algorithm 1)."""

    # A step is rate * m / (sqrt(v) + epsilon), where m and v are running means of the gradient and of its square, corrected for their
    # start at 0. So each number moves by about `rate`, whatever the size of its gradient. torch's fused operator does it in one pass
    # over memory.

    def _move(self, parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], rate: float) -> None:
        if not state:
            state["step"] = torch.zeros((), device=parameter.device)
            state["exp_avg"] = torch.zeros_like(parameter)
            state["exp_avg_sq"] = torch.zeros_like(parameter)
        state["step"] += 1
        # Outside torch.optim the operator has no public name.
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
    """The optimiser Muon (K. Jordan et al. 2024) for `count` matrices, [count, rows, columns]."""

    # A step is the momentum with all singular values set to about 1: the steepest descent for the spectral norm. Gradients of hidden
    # layers have few large singular values; Muon moves equally far in all directions. In recipe `best` it gains 1.5 dB over Adam
    # (docs/reports/recipes.md#parts-of-the-recipe). It is defined for matrices only, so biases and latents use Adam.

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
    """Return the optimisers that `training` asks for, that of the latents first."""
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
