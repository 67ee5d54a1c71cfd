"""The loss that is worked out piece by piece equals autograd over the decoders, in float64."""

from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.torch_twin import AdapterStack, DecoderStack
from ntc.codec.grid.training import optimizers as decoder_loss
from ntc.codec.grid.training.optimizers import squared_error

CONFIG = GridConfig(hidden_width=16, adapters=True, adapter_output=True)


@dataclass(frozen=True, eq=False)
class Problem:
    """Decoders, adapters and samples of five textures."""

    decoders: DecoderStack
    adapters: AdapterStack
    decoder: Tensor
    latents: Tensor
    known: Tensor
    targets: Tensor
    mask: Tensor

    def gradients(self, losses: Tensor, weights: Tensor) -> list[Tensor]:
        """Of the weighted losses in everything that is trained."""
        wanted = [self.latents, *self.adapters.parameters(), *self.decoders.parameters()]
        return list(torch.autograd.grad((losses * weights).sum(), wanted, allow_unused=True))


def problem(samples: int, spread: float) -> Problem:
    """Random numbers of this size."""
    generator = torch.Generator().manual_seed(samples)
    decoders = DecoderStack(CONFIG, 2, generator).double()
    adapters = AdapterStack(CONFIG, 5).double()
    with torch.no_grad():
        for values in adapters.parameters():
            values.add_(torch.randn(values.shape, generator=generator, dtype=torch.float64) * 0.3)
    latents = torch.randn(5, samples, 4, generator=generator, dtype=torch.float64) * spread
    # Channels that do not count, and others whose errors are worth more or less.
    mask = (torch.rand(5, 3, generator=generator) < 0.7).double() * torch.tensor([1.0, 1.5, 0.5]).double()
    return Problem(
        decoders,
        adapters,
        torch.tensor([0, 1, 1, 0, 1]),
        latents.requires_grad_(True),
        torch.randn(5, samples, CONFIG.decoder_inputs - 4, generator=generator, dtype=torch.float64),
        torch.rand(5, samples, 3, generator=generator, dtype=torch.float64),
        mask,
    )


@pytest.mark.parametrize("samples", [1, 7, 40])
@pytest.mark.parametrize("rows", [1, 16, 1000])
@pytest.mark.parametrize("spread", [1e-9, 1.0, 1e6])
def test_losses_and_gradients_are_those_of_autograd(
    monkeypatch: pytest.MonkeyPatch, samples: int, rows: int, spread: float
) -> None:
    monkeypatch.setattr(decoder_loss, "ROWS_AT_ONCE_CPU", rows)
    given = problem(samples, spread)
    weights = torch.linspace(0.5, 2.0, 5, dtype=torch.float64)
    inputs = torch.cat([given.latents, given.known], dim=2)
    decoded = given.decoders(inputs, given.decoder, given.adapters)
    plain = ((decoded - given.targets) * given.mask[:, None]).square().sum(dim=(1, 2))
    expected = given.gradients(plain, weights)
    layers = given.decoders.layers(given.decoder, given.adapters)
    fast = squared_error(layers, CONFIG.leaky_slope, given.latents, given.known, given.targets, given.mask)
    torch.testing.assert_close(fast, plain)
    for found, wanted in zip(given.gradients(fast, weights), expected, strict=True):
        # The decoders' hidden biases have no part where adapters have their own.
        assert (found is None) == (wanted is None)
        if wanted is not None:
            torch.testing.assert_close(found, wanted)


def test_some_textures_alone_have_the_losses_they_have_among_all() -> None:
    given = problem(7, 1.0)
    some = torch.tensor([3, 1])
    everything = given.decoders.layers(given.decoder, given.adapters)
    fewer = given.decoders.layers(given.decoder[some], given.adapters, some)
    whole = squared_error(everything, 0.01, given.latents, given.known, given.targets, given.mask)
    part = squared_error(fewer, 0.01, given.latents[some], given.known[some], given.targets[some], given.mask[some])
    torch.testing.assert_close(part, whole[some])
