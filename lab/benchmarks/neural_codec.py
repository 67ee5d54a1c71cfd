"""Codec `block` beside a neural codec trained to convergence on one material: an upper bound of what training gains.

The neural codec follows Vaidyanathan et al. 2023 (Random-Access Neural Compression of Material Textures): two grids, of which the fine
one gives the four corners around a texel side by side and the coarser one is blended, a positional encoding, and a network with two
hidden layers. Grids are rounded by noise while they train; then they are rounded and the network is tuned. It encodes mip 0 alone.

python -m lab.benchmarks.neural_codec SCENE --texture-size 256 --steps 10000 --json F.json
"""

import json
import math
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from lab.runner import options, run, write_record
from lab.studies.set_quality import pack_bits_per_texel
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.rate import block_count, config_for_bits, config_for_words
from ntc.codec.encoding import texture_set
from ntc.codec.maps import EQUAL_WEIGHTS
from ntc.codec.model import Grouping
from ntc.codec.quality import psnr_db
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.training.encode import encode_textures
from viewer.scene.load import load_scene
from viewer.scene.source_textures import source_textures

MIPS: tuple[Literal[2, 4], ...] = (2, 4)
"""Of a code of codec `block`."""
TUNED_SHARE = 0.1
"""Of the steps: the last ones, in which grids are rounded and the network alone is trained."""
GRID_RATE, NETWORK_RATE, TUNING_RATE = 0.01, 0.005, 0.002
LEAST_RATE = 0.02
"""Of a learning rate, at the end of its cosine."""
OCTAVES = 3
"""Of the positional encoding, from a period of 8 texels down."""
TEXELS_AT_ONCE = 1 << 15


@dataclass(frozen=True)
class NeuralShape:
    """The grids of the neural codec, and its network."""

    fine_channels: int
    coarse_channels: int
    bits: int
    """Of each number in the grids."""
    fine_step: int = 4
    """Texels per cell of the finer grid along one side."""
    coarse_step: int = 8
    width: int = 64
    """Of the hidden layers."""

    @property
    def grid_bits(self) -> float:
        """Bits of the grids per texel."""
        return self.bits * (self.fine_channels / self.fine_step**2 + self.coarse_channels / self.coarse_step**2)


SHAPES = (NeuralShape(12, 20, 2), NeuralShape(12, 20, 4))
"""2.1 and 4.2 bits a texel of grids."""


class NeuralCodec(nn.Module):
    """Two grids and a network for one square material of `side` texels and `channels` channels."""

    def __init__(self, shape: NeuralShape, side: int, channels: int) -> None:
        super().__init__()
        self.shape, self.side = shape, side
        self.fine = self._grid(shape.fine_channels, side // shape.fine_step)
        self.coarse = self._grid(shape.coarse_channels, side // shape.coarse_step)
        inputs = 4 * shape.fine_channels + shape.coarse_channels + 4 * OCTAVES
        self.network = nn.Sequential(
            nn.Linear(inputs, shape.width),
            nn.GELU(),
            nn.Linear(shape.width, shape.width),
            nn.GELU(),
            nn.Linear(shape.width, channels),
        )

    def _grid(self, channels: int, side: int) -> nn.Parameter:
        return nn.Parameter(0.2 * (torch.rand(channels, side, side) - 0.5))

    @property
    def network_bits(self) -> float:
        """Bits of the network per texel, 16 a number."""
        return 16.0 * sum(each.numel() for each in self.network.parameters()) / self.side**2

    def rounded(self, grid: torch.Tensor) -> torch.Tensor:
        """Numbers of `grid`, which lie in [-0.5, 0.5], as they are stored."""
        step = 2.0**-self.shape.bits
        return (torch.floor(self._inside(grid) / step) + 0.5) * step

    def _inside(self, grid: torch.Tensor) -> torch.Tensor:
        step = 2.0**-self.shape.bits
        return grid.clamp(0.5 * step - 0.5, 0.5 - 0.5 * step)

    def round_grids(self) -> None:
        """Round both grids for good."""
        with torch.no_grad():
            for grid in (self.fine, self.coarse):
                grid.copy_(self.rounded(grid))
                grid.requires_grad_(False)

    def forward(self, texels: torch.Tensor, noise: bool) -> torch.Tensor:
        """[N, channels] values of `texels` [N] numbered row by row; with `noise` as large as rounding."""
        grids = [self._inside(grid) for grid in (self.fine, self.coarse)]
        if noise:
            grids = [grid + (torch.rand_like(grid) - 0.5) * 2.0**-self.shape.bits for grid in grids]
        y, x = texels // self.side, texels % self.side
        corners = self._corners(grids[0], x, y, self.shape.fine_step)
        coarse = self._corners(grids[1], x, y, self.shape.coarse_step)
        weights = self._weights(x, y, self.shape.coarse_step)
        blended = torch.stack([weight * corner for weight, corner in zip(weights, coarse, strict=True)]).sum(0)
        found: torch.Tensor = self.network(torch.cat([*corners, blended, self._positions(x, y)]).T)
        return found

    def _corners(self, grid: torch.Tensor, x: torch.Tensor, y: torch.Tensor, step: int) -> list[torch.Tensor]:
        """Four times [channels, N]: the cells around each texel, which repeat beyond the edges."""
        side = grid.shape[1]
        u = torch.floor((x + 0.5) / step - 0.5).long()
        v = torch.floor((y + 0.5) / step - 0.5).long()
        return [grid[:, (v + j) % side, (u + i) % side] for j in (0, 1) for i in (0, 1)]

    def _weights(self, x: torch.Tensor, y: torch.Tensor, step: int) -> list[torch.Tensor]:
        u, v = (x + 0.5) / step - 0.5, (y + 0.5) / step - 0.5
        u, v = u - torch.floor(u), v - torch.floor(v)
        return [a * b for a in (1.0 - v, v) for b in (1.0 - u, u)]

    def _positions(self, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """[4 x OCTAVES, N]: triangle waves of x and y, and the same a quarter of a period later."""
        waves = []
        for octave in range(OCTAVES):
            for place in (x, y):
                for phase in (0.0, 0.25):
                    turn = place * (2.0**octave / 8.0) + phase
                    waves.append(4.0 * (turn - torch.floor(turn) - 0.5).abs() - 1.0)
        return torch.stack(waves)


def trained_image(
    source: SourceTexture, shape: NeuralShape, steps: int, batch: int, seed: int
) -> tuple[NeuralCodec, NDArray[np.uint8], list[dict[str, float]]]:
    """(the codec, [H, W, C] uint8 of its mip 0, PSNR over the training) for a square `source`."""
    torch.manual_seed(seed)
    side, channels = source.pixels.shape[0], source.channels
    truth = torch.from_numpy(source.pixels.reshape(-1, channels).astype(np.float32) / np.float32(255.0))
    codec = NeuralCodec(shape, side, channels)
    rates = [GRID_RATE, NETWORK_RATE]
    optimizer = torch.optim.Adam(
        [{"params": [codec.fine, codec.coarse]}, {"params": list(codec.network.parameters())}], eps=1e-15
    )
    tuned, curve = round((1.0 - TUNED_SHARE) * steps), list[dict[str, float]]()
    for step in range(steps):
        if step == tuned:
            codec.round_grids()
            rates, optimizer = [TUNING_RATE], torch.optim.Adam(codec.network.parameters())
        done = step / tuned if step < tuned else (step - tuned) / (steps - tuned)
        for group, rate in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = rate * max(LEAST_RATE, 0.5 * (1.0 + math.cos(math.pi * done)))
        texels = torch.randint(0, len(truth), (batch,))
        loss = (codec(texels, noise=step < tuned) - truth[texels]).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if (step + 1) % max(1, steps // 10) == 0:
            curve.append({"step": step + 1, "psnr_db": psnr_db(decoded(codec, source), source.pixels)})
            sys.stdout.write(f"{json.dumps(curve[-1])}\n")
            sys.stdout.flush()
    return codec, decoded(codec, source), curve


def decoded(codec: NeuralCodec, source: SourceTexture) -> NDArray[np.uint8]:
    """[H, W, C] uint8: mip 0 with grids as they are stored."""
    kept = [grid.detach().clone() for grid in (codec.fine, codec.coarse)]
    with torch.no_grad():
        for grid in (codec.fine, codec.coarse):
            grid.copy_(codec.rounded(grid))
        parts = [
            codec(torch.arange(start, min(start + TEXELS_AT_ONCE, codec.side**2)), noise=False)
            for start in range(0, codec.side**2, TEXELS_AT_ONCE)
        ]
        for grid, before in zip((codec.fine, codec.coarse), kept, strict=True):
            grid.copy_(before)
    values = torch.cat(parts).clamp(0.0, 1.0).numpy()
    return np.rint(values * 255.0).astype(np.uint8).reshape(source.pixels.shape)


def code_settings(source: SourceTexture, bits: float, mips: Literal[2, 4]) -> BlockConfig:
    """Settings whose codes take `bits` bits per texel, all mips, so many in a code; tables are not counted."""
    known = texture_set([source], 1)
    first = replace(config_for_words(2.0 * bits, known), mips=mips)
    words = bits * source.pixels.shape[0] * source.pixels.shape[1] / (32.0 * block_count([source.size], first))
    return replace(config_for_words(words, known), mips=mips, mean_words=words)


def block_figures(source: SourceTexture, config: BlockConfig) -> dict[str, Any]:
    """Codec `block` under `config`: PSNR of mip 0, and bits with its tables."""
    began = time.process_time()
    pack = encode_textures([source], Grouping("single", (0,)), config, BlockOptions())
    seconds = time.process_time() - began
    image = codec_of(pack.config).torch_twin(pack, "cpu").decode_image(0)
    return {
        "mips": config.mips,
        "psnr_db": psnr_db(image, source.pixels),
        "bits_per_texel": pack_bits_per_texel(pack),
        "seconds": seconds,
    }


def measured(source: SourceTexture, shape: NeuralShape, steps: int, batch: int, seed: int) -> dict[str, Any]:
    """Both codecs at the bits of the neural codec's grids."""
    two, four = (block_figures(source, code_settings(source, shape.grid_bits, mips)) for mips in MIPS)
    began, clock = time.process_time(), time.monotonic()
    codec, image, curve = trained_image(source, shape, steps, batch, seed)
    return {
        "material": source.name,
        "maps": list(source.maps),
        "texels": source.pixels.shape[0],
        "shape": asdict(shape),
        "steps": steps,
        "batch": batch,
        "code_bits_per_texel": shape.grid_bits,
        "neural": {
            "psnr_db": psnr_db(image, source.pixels),
            "bits_per_texel": shape.grid_bits + codec.network_bits,
            "processor_minutes": (time.process_time() - began) / 60.0,
            "minutes": (time.monotonic() - clock) / 60.0,
            "curve": curve,
        },
        "block": two,
        "block_of_four_mips": four,
        "block_of_equal_bytes": block_figures(
            source, config_for_bits(shape.grid_bits + codec.network_bits, texture_set([source], 1))
        ),
    }


def main() -> None:
    """Train, compare, print, and write the record. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument(
        "--material", default="", help="part of the name of its first map; default: the first material set"
    )
    parser.add_argument("--texture-size", type=int, default=512)
    parser.add_argument("--steps", type=int, default=15_000)
    parser.add_argument("--batch", type=int, default=1 << 14, help="texels of a step")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.set_num_threads(1)
    found = source_textures(load_scene(given.scene), given.texture_size, "all")
    sources = [each for each in found if len(each.maps) > 1 and given.material in each.name]
    if not sources:
        raise InputError(f"{given.scene}: has no such material set")
    # Both codecs make the mean error of all channels least.
    source = SourceTexture(**{**vars(sources[0]), "map_weights": EQUAL_WEIGHTS})
    rows = list[dict[str, Any]]()
    for shape in SHAPES:
        rows.append(measured(source, shape, given.steps, given.batch, given.seed))
        sys.stdout.write(f"{json.dumps(rows[-1])}\n")
        write_record(given.json, {"rows": rows})


if __name__ == "__main__":
    run(main)
