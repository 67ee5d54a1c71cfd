"""Steps along orthogonal momentum."""

import pytest
import torch

from ntc.codec.grid.training.optimizers import Muon, orthogonalised


@pytest.mark.parametrize("shape", [(3, 64, 17), (2, 64, 64), (4, 8, 20), (1, 1, 1)])
def test_singular_values_are_carried_near_one(shape: tuple[int, int, int]) -> None:
    matrices = torch.randn(shape, generator=torch.Generator().manual_seed(0)) * 1e-3
    values = torch.linalg.svdvals(orthogonalised(matrices))
    # A square matrix at chance has a few singular values of nearly nothing, which five rounds do not lift.
    assert (values > 0.3).float().mean() > 0.9
    assert values.max() < 1.4


def test_each_matrix_is_made_orthogonal_by_itself() -> None:
    stack = torch.randn(5, 6, 9, generator=torch.Generator().manual_seed(1)) * torch.logspace(-6, 3, 5)[:, None, None]
    together = orthogonalised(stack)
    for matrix, found in zip(stack, together, strict=True):
        torch.testing.assert_close(orthogonalised(matrix[None])[0], found, atol=1e-5, rtol=1e-5)


def test_no_gradient_is_no_step_and_a_zero_gradient_stays_finite() -> None:
    still, zero = (torch.nn.Parameter(torch.ones(2, 3, 4)) for _ in range(2))
    zero.grad = torch.zeros(2, 3, 4)
    Muon([still, zero], lr=0.1).step()
    for parameter in (still, zero):
        torch.testing.assert_close(parameter.detach(), torch.ones(2, 3, 4))


def test_it_fits_a_matrix_sooner_than_small_steps_would() -> None:
    generator = torch.Generator().manual_seed(2)
    wanted, inputs = torch.randn(1, 8, 16, generator=generator), torch.randn(200, 16, generator=generator)
    inputs = inputs * torch.logspace(0, -2, 16)
    found = torch.nn.Parameter(torch.zeros(1, 8, 16))
    optimizer = Muon([found], lr=0.1)
    losses = []
    for step in range(300):
        optimizer.param_groups[0]["lr"] = 0.1 * (1.0 - step / 300)
        loss = ((inputs @ (found - wanted).transpose(1, 2)) ** 2).mean()
        losses.append(loss.item())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert losses[-1] < 1e-2 * losses[0]
