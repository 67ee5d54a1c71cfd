"""How measures of quality agree: textures at several rates under PSNR, SSIM, FLIP, SSIMULACRA2 and ColorVideoVDP, by rank correlation.

python -m lab.benchmarks.measures_agree FOLDER --json FILE --plot FILE.png: codec `block` with the tables that ship, so that each rate
is one encoding. ColorVideoVDP stands for people: it was fitted to what they saw. Needs the extra `perceptual`.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import spearmanr

from lab.commands.rate_points import read_textures
from lab.runner import options, report, run, write_figure
from ntc.api import decode, encode
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import BitsTarget
from ntc.codec.quality import finite_or_none, psnr_db
from ntc.metrics.image_quality import flip, ssim
from ntc.metrics.perceptual import jod, ssimulacra2

BITS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
MOST_PSNR_DB = 99.0
MEASURES: dict[str, Callable[[NDArray[np.uint8], NDArray[np.uint8]], float]] = {
    "PSNR": lambda reference, test: finite_or_none(psnr_db(reference, test)) or MOST_PSNR_DB,
    "SSIM": ssim,
    "FLIP": lambda reference, test: -flip(reference, test),
    "SSIMULACRA2": ssimulacra2,
    "JOD": jod,
}
"""Measures by name, all of them higher where the picture is better."""


def measured(folder: Path, side: int, most: int) -> NDArray[np.float64]:
    """Return [textures, rates, measures] of the middle of each texture."""
    textures = read_textures(folder, side, most)
    found = np.zeros((len(textures), len(BITS), len(MEASURES)))
    for rate, bits in enumerate(BITS):
        pack = encode(textures, grouping=GroupingConfig("universal"), target=BitsTarget(bits))
        for index, texture in enumerate(textures):
            decoded = decode(pack, index)
            found[index, rate] = [own(texture.pixels, decoded) for own in MEASURES.values()]
        sys.stderr.write(f"{bits:g} bits done\n")
    return found


def correlations(values: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Return Spearman's rank correlation of each measure with ColorVideoVDP: over all pictures, over textures at one rate, over the
    rates of one texture (means)."""
    people = values[..., -1]
    rows = []
    for place, name in enumerate(MEASURES):
        own = values[..., place]
        rows.append(
            {
                "measure": name,
                "all pictures": float(spearmanr(own.ravel(), people.ravel()).statistic),
                "textures at one rate": float(
                    np.mean([spearmanr(own[:, rate], people[:, rate]).statistic for rate in range(len(BITS))])
                ),
                "rates of one texture": float(
                    np.nanmean([spearmanr(a, b).statistic for a, b in zip(own, people, strict=True)])
                ),
            }
        )
    return rows


def figure_of(values: NDArray[np.float64]) -> Figure:
    """Return a plot of each measure over ColorVideoVDP, a colour for each rate."""
    figure = Figure(figsize=(11, 3), layout="constrained")
    for place, (name, axes) in enumerate(zip(list(MEASURES)[:-1], figure.subplots(1, len(MEASURES) - 1), strict=True)):
        for rate, bits in enumerate(BITS):
            sign = -1.0 if name == "FLIP" else 1.0
            axes.scatter(values[:, rate, -1], sign * values[:, rate, place], s=4, alpha=0.5, label=f"{bits:g} bits")
        axes.set(xlabel="JOD (ColorVideoVDP)", title=name)
    axes.legend(fontsize=6)
    return figure


def main() -> None:
    """Run the benchmark. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--texture-size", type=int, default=128)
    parser.add_argument("--most", type=int, default=200)
    parser.add_argument("--plot", type=Path)
    given = parser.parse_args()
    values = measured(given.folder, given.texture_size, given.most)
    facts = {"textures": len(values), "side": given.texture_size, "bits": list(BITS)}
    report("Rank correlation with ColorVideoVDP", correlations(values), facts, given.json)
    if given.plot is not None:
        write_figure(given.plot, figure_of(values))


if __name__ == "__main__":
    run(main)
