"""The latents of all textures in training: blended reads, and the way back into a gradient that keeps its memory."""

from collections.abc import Iterable

import torch
from torch import Tensor, nn


class LatentTable:
    """[cells, channels] trained latents. Reads are not recorded by autograd: `add_gradient` is their way back.

    Autograd would allocate a gradient as large as the table in each step, and torch's own ways to add rows at indices (a sort,
    or one addition a row) take longer than the decoders do.
    """

    def __init__(self, start: Tensor) -> None:
        self.values = nn.Parameter(start)
        self._gradient = torch.zeros_like(start)
        self._places: dict[int, Tensor] = {}
        self._spread: dict[int, Tensor] = {}
        self._channels = torch.arange(start.shape[1], device=start.device)

    def read(self, index: Tensor, weights: Tensor) -> Tensor:
        """[N, channels]: sum over k of cells `index` [N, k] times `weights` [N, k]."""
        return torch.nn.functional.embedding_bag(index, self.values.detach(), per_sample_weights=weights, mode="sum")

    def set_gradient(self, parts: Iterable[tuple[Tensor, Tensor, Tensor]]) -> None:
        """The gradient of the values from (index [N, k], weights [N, k], gradient [N, channels] of what was read there)."""
        self._gradient.zero_()
        for index, weights, gradient in parts:
            count = index.numel() * gradient.shape[1]
            if count not in self._places:
                self._places[count] = torch.empty(count, dtype=torch.int64, device=index.device)
                self._spread[count] = torch.empty(count, dtype=gradient.dtype, device=index.device)
            shape = (*index.shape, gradient.shape[1])
            places, spread = self._places[count].view(shape), self._spread[count].view(shape)
            torch.add(index.unsqueeze(2) * gradient.shape[1], self._channels, out=places)
            torch.mul(weights.unsqueeze(2), gradient.unsqueeze(1), out=spread)
            self._gradient.view(-1).scatter_add_(0, places.view(-1), spread.view(-1))
        self.values.grad = self._gradient
