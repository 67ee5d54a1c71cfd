"""A straightforward training loop in plain torch: the baseline of `training_throughput`.

One module a decoder, one grid a texture read by `grid_sample`, one loss a group, Adam for everything, groups one after the
other in a step. Same codec shape, samples, rates and losses as the paper's recipe; no mips, no adapters, no rounding.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from ntc.codec.grid.model import GridConfig
from ntc.codec.textures import SourceTexture


def triangle_waves(texel: Tensor, octaves: int) -> Tensor:
    """[N, 4 octaves] of texel coordinates [N, 2]."""
    waves = []
    for axis in range(2):
        for octave in range(octaves):
            for phase in (0.0, 0.25):
                turns = texel[:, axis] / 2.0 ** (octave + 1) + phase
                waves.append(4.0 * (turns - turns.floor() - 0.5).abs() - 1.0)
    return torch.stack(waves, dim=1)


class PlainTraining:
    """Grids and decoders of textures in groups; all textures wrap around."""

    def __init__(
        self, textures: Sequence[SourceTexture], groups: Sequence[int], config: GridConfig, device: torch.device
    ) -> None:
        self._config, self._device = config, device
        self._images = [
            torch.from_numpy(texture.pixels[..., : config.output_channels]).to(device).float() / 255.0
            for texture in textures
        ]
        self._members = [[i for i, group in enumerate(groups) if group == number] for number in range(max(groups) + 1)]
        cells = [(-(-t.size[1] // config.downscale), -(-t.size[0] // config.downscale)) for t in textures]
        self._grids = [
            nn.Parameter((torch.rand(1, config.latent_channels, *shape, device=device) * 2.0 - 1.0) * 0.25)
            for shape in cells
        ]
        width = config.hidden_width
        self._decoders = [
            nn.Sequential(
                nn.Linear(config.latent_channels + config.positional_inputs, width),
                nn.LeakyReLU(config.leaky_slope),
                nn.Linear(width, width),
                nn.LeakyReLU(config.leaky_slope),
                nn.Linear(width, config.output_channels),
            ).to(device)
            for _ in self._members
        ]
        weights = [parameter for decoder in self._decoders for parameter in decoder.parameters()]
        self._optimizer = torch.optim.Adam([{"params": self._grids, "lr": 4e-3}, {"params": weights, "lr": 4e-4}])

    def step(self, per_texture: int) -> float:
        """One step with so many samples of each texture; the mean loss."""
        self._optimizer.zero_grad()
        total = 0.0
        for members, decoder in zip(self._members, self._decoders, strict=True):
            inputs, targets = [], []
            for index in members:
                image, grid = self._images[index], self._grids[index]
                height, width = image.shape[:2]
                row = torch.randint(height, (per_texture,), device=self._device)
                column = torch.randint(width, (per_texture,), device=self._device)
                texel = torch.stack([column, row], dim=1) + 0.5
                at = texel / torch.tensor([width, height], device=self._device) * 2.0 - 1.0
                sampled = nn.functional.grid_sample(grid, at[None, None], padding_mode="border", align_corners=False)
                waves = triangle_waves(texel, self._config.positional_octaves)
                inputs.append(torch.cat([sampled[0, :, 0].t(), waves], dim=1))
                targets.append(image[row, column])
            loss = nn.functional.mse_loss(decoder(torch.cat(inputs)), torch.cat(targets))
            torch.autograd.backward([loss])
            total += float(loss.detach()) * len(members)
        self._optimizer.step()
        return total / len(self._images)
