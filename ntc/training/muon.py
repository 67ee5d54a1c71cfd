"""Muon: steps of matrices along their momentum made orthogonal (K. Jordan et al., 2024), for stacks of small matrices."""

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor

MOMENTUM = 0.95
ROUNDS = 5
QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients of the iteration that carries all singular values towards 1 (op. cit.)."""
STEP_LIKE_ADAM = 0.2
"""Root mean square of a step's entries, about that of Adam's, so that rates mean alike (J. Liu et al., 2025)."""
SMALLEST = 1e-12


def orthogonalised(matrices: Tensor) -> Tensor:
    """[count, rows, columns]: each matrix with its singular values carried near 1, by a Newton-Schulz iteration."""
    a, b, c = QUINTIC
    values = matrices / (matrices.norm(dim=(1, 2), keepdim=True) + SMALLEST)
    tall = values.shape[1] > values.shape[2]
    if tall:
        values = values.transpose(1, 2)
    for _ in range(ROUNDS):
        square = values @ values.transpose(1, 2)
        values = a * values + (b * square + c * square @ square) @ values
    return values.transpose(1, 2) if tall else values


class Muon(torch.optim.Optimizer):
    """For parameters of shape [count, rows, columns], each of the `count` matrices by itself."""

    def __init__(self, parameters: Iterable[Tensor], lr: float) -> None:
        super().__init__(parameters, {"lr": lr})

    @torch.no_grad()
    def step(self, closure: Any = None) -> None:  # type: ignore[override]
        """One step with Nesterov momentum."""
        for group in self.param_groups:
            for parameter in group["params"]:
                gradient = parameter.grad
                if gradient is None:
                    continue
                state = self.state[parameter]
                if not state:
                    state["momentum"] = torch.zeros_like(parameter)
                momentum = state["momentum"].mul_(MOMENTUM).add_(gradient)
                direction = orthogonalised(gradient + MOMENTUM * momentum)
                size = STEP_LIKE_ADAM * max(parameter.shape[1:]) ** 0.5
                parameter.sub_(direction, alpha=size * group["lr"])
