"""Coefficients that coarse mips of codec `block` need: how many could be left out, with an error of at most half an 8-bit step.

    python -m lab.benchmarks.coarse_mips PACK ... --json lab/benchmarks/results/coarse_mips.json

A coefficient is at most the outermost level of its depth times its scale. Times the largest number of its row in a mip, and times the
texture's largest weight of its channel, that bounds what leaving it out changes at any texel, whatever the code. The smallest are left
out first, while their sum stays below half a step. *On average* takes root mean squares of coefficients of unit variance in place of
the largest values, and certifies nothing.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from lab.runner import report, run
from ntc.codec.block.codes import unpacked_codes
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, averaged_rows
from ntc.codec.block.reference import decode_coefficients, texture_codes
from ntc.codec.block.trellis import level_table, scale_values
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack

Array = NDArray[np.float64]
HALF_STEP: Final = 0.5 / 255.0
"""Most that the coefficients that are left out change a value in [0, 1]."""


@dataclass(frozen=True)
class Changes:
    """What each coefficient adds to values of a coarse mip: [sizes of codes, modes, coefficients], 0 where it has no bits."""

    most: Array
    mean: Array
    """Root mean square."""


def changes(texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, mip: int) -> Changes:
    """Return what coefficients add at a code's mip `mip`, whatever the codes hold."""
    depths = decoder.depths(config)
    scales = scale_values(decoder.scales) * scale_values(decoder.basis_scale)
    weights = np.abs(texture.axes.astype(np.float64)).max(axis=0)[decoder.channels]
    rows = averaged_rows(decoder.basis.astype(np.float64), config, mip)
    outermost = np.abs(level_table()).max(axis=1)[depths]
    most = outermost * scales * np.abs(rows).max(axis=1) * weights
    mean = (depths > 0) * scales * np.sqrt(np.square(rows).mean(axis=1)) * weights
    return Changes(most, mean)


def _smallest(costs: Array) -> NDArray[np.bool_]:
    """Which of the smallest of `costs` [..., coefficients] add up to at most 1."""
    order = np.argsort(costs, axis=-1)
    fits = np.cumsum(np.take_along_axis(costs, order, axis=-1), axis=-1) <= 1.0
    found = np.zeros(costs.shape, np.bool_)
    np.put_along_axis(found, order, fits, axis=-1)
    return found


def left_out(own: Changes, certified: bool = True) -> NDArray[np.bool_]:
    """[sizes of codes, modes, coefficients]: which can be left out, without those that have no bits."""
    costs = own.most / HALF_STEP if certified else np.square(own.mean / HALF_STEP)
    return _smallest(costs) & (own.mean > 0.0)


def changed_values(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int, dropped: NDArray[np.bool_]
) -> Array:
    """[blocks, texels, channels] float64: values of mip `level` without `dropped` coefficients, less those with all of them."""
    stored = texture_codes(texture, config, level)
    codes = unpacked_codes(stored, decoder, config)
    own = dropped[stored.sizes, stored.codes[:, 0] & np.uint32(config.modes - 1)]
    coefficients = decode_coefficients(codes, decoder) * scale_values(decoder.basis_scale) * own
    mip = texture_levels(texture, config)[level].mip_of_cell
    rows = averaged_rows(decoder.basis.astype(np.float64), config, mip)
    shown = [
        coefficients[:, decoder.channels == channel] @ rows[decoder.channels == channel]
        for channel in range(config.output_channels)
    ]
    return -np.stack(shown, axis=-1) @ texture.axes.astype(np.float64).T


def rows_of(pack: Pack) -> list[dict[str, Any]]:
    """A row for each coarse mip of a code: coefficients of a code as means over the codes of mip 0. Raises InputError."""
    if not isinstance(pack.config, BlockConfig) or pack.config.format < 2:
        raise InputError(f"{pack.name}: only codec block, format 2, has codes of several mips")
    config, found = pack.config, list[dict[str, Any]]()
    for mip in range(1, config.mips):
        counts, codes = np.zeros(3), 0
        for texture in cast("tuple[BlockTexture, ...]", pack.textures):
            decoder = cast(BlockDecoder, pack.decoders[texture.group])
            own = changes(texture, decoder, config, mip)
            stored = texture_codes(texture, config, 0)
            kinds = stored.sizes, stored.codes[:, 0] & np.uint32(config.modes - 1)
            for number, which in enumerate((own.mean > 0.0, left_out(own), left_out(own, certified=False))):
                counts[number] += which.sum(axis=-1)[kinds].sum()
            codes += len(stored.codes)
        every, certified, usual = (counts / codes).tolist()
        found.append(
            {
                "pack": pack.name,
                "mip of the code": mip,
                "coefficients": round(every, 1),
                "needed": round(every - certified, 1),
                "needed on average": round(every - usual, 1),
            }
        )
    return found


def main() -> None:
    """Print and write the table. Raises InputError."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("packs", nargs="+", type=Path, metavar="PACK")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = [{**row, "pack": path.stem} for path in options.packs for row in rows_of(read_pack(path))]
    report("coefficients that coarse mips need", rows, {"most error": "half an 8-bit step"}, options.json)


if __name__ == "__main__":
    run(main)
