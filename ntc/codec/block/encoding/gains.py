"""Gains of the shipped tables for whole materials: how strong each coefficient is in the textures of a group.

Shipped tables are fitted to many materials. In one group, a map may be far stronger or weaker, and finer or coarser, than on average.
So each group stores a gain in steps of 1/16 octave for each band of coefficients, or for each coefficient of large textures. It is the
ratio of the group's energy to that of the tables, from samples. Bit allocations follow from scales times gains, so bits move to the
strong coefficients as well.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Sample, sample_textures
from ntc.codec.block.encoding.transform import Basis, one_thread, projected
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.trellis import SCALE_STEPS_PER_OCTAVE, scale_values
from ntc.codec.block.universal import FINE_BLOCKS, SetTables, scaled_decoder, set_config, set_tables
from ntc.codec.maps import joint_maps
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture

COMPARED_BLOCKS = 1000
"""Blocks of a texture that decide which textures share gains."""
COMPARED_TEXELS = 1024
"""Texels along one side of the part of a texture that is compared."""
SHARING_ROUNDS = 20
LEAST_ENERGY = 1e-9
MOST_WITHIN = 40
"""Steps at most by which a coefficient's gain differs from that of its band: 15 dB."""
FAINT_STEPS = 72
"""Difference to the strongest band, in steps of 1/8 octave of energy, from which on a band counts as empty: 27 dB."""


def band_energies(squares: NDArray[np.float64], bands: NDArray[np.integer], count: int) -> NDArray[np.float64]:
    """[bands] float64: energy of each of `count` bands, of mean squares [coefficients] of coefficients in `bands` [coefficients]."""
    return np.asarray(np.bincount(bands, squares, count), np.float64)


def _mean_squares(blocks: NDArray[np.float32], tables: SetTables, config: BlockConfig) -> NDArray[np.float64]:
    """[coefficients] float64: mean squares of the coefficients of `blocks` [blocks, values]."""
    decoder = tables.decoder
    projections = Basis(decoder.basis, decoder.channels, decoder.basis_scale).projections(config)
    return np.asarray(np.square(projected(blocks, projections)).mean(0, dtype=np.float64))


def steps_between(energies: NDArray[np.float64], references: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the steps of 1/16 octave of amplitude that lead from energies `references` to `energies`, of their shape."""
    ratios = np.maximum(energies, LEAST_ENERGY) / np.maximum(references, 1e-12)
    return np.asarray(0.5 * SCALE_STEPS_PER_OCTAVE * np.log2(ratios), np.float64)


def gains_of(squares: NDArray[np.float64], tables: SetTables, fine: bool) -> NDArray[np.int8]:
    """[coefficients] int8, or [bands] where they are not `fine`: gains of a group whose coefficients have mean squares `squares`
    [coefficients]."""
    count, variances = len(tables.energies), np.square(scale_values(tables.decoder.scales)).mean(0)
    group_energies, shipped = (band_energies(each, tables.bands, count) for each in (squares, variances))
    of_band = steps_between(group_energies, tables.energies)
    if not fine:
        return _stored_gains(of_band)
    # Within its band, a coefficient is as strong as modes have it on average, or stronger or weaker by at most so much.
    within = steps_between(
        squares / np.maximum(group_energies, LEAST_ENERGY)[tables.bands], variances / shipped[tables.bands]
    )
    return _stored_gains(np.rint(of_band[tables.bands]) + np.clip(within, -MOST_WITHIN, MOST_WITHIN))


def _stored_gains(steps: NDArray[np.float64]) -> NDArray[np.int8]:
    gains: NDArray[np.int8] = np.clip(np.rint(steps), -128, 127).astype(np.int8)
    return gains


def fitted_gains(samples: Sequence[Sample], config: BlockConfig) -> BlockDecoder:
    """Return the decoder of a group under shipped tables: their scales times gains, by samples of the group's textures."""
    tables = set_tables(config.maps, config.output_channels, config.tables)
    with one_thread():
        squares = np.mean([_mean_squares(sample.blocks, tables, config) for sample in samples], axis=0)
    fine = max(sample.block_count for sample in samples) >= FINE_BLOCKS
    return scaled_decoder(tables, gains_of(squares, tables, fine))


def shared_gains(textures: Sequence[SourceTexture], most: int) -> tuple[int, ...]:
    """Return the group of each texture, at most `most` groups: similar textures share gains."""
    config = set_config(*joint_maps((texture.maps, texture.channels) for texture in textures))
    tables = set_tables(config.maps, config.output_channels, config.tables)
    levels = np.array([_band_levels(texture, tables, config) for texture in textures])
    return Grouping.of_labels("", _nearest_centres(levels, most).tolist(), {}).groups


def _band_levels(texture: SourceTexture, tables: SetTables, config: BlockConfig) -> NDArray[np.float64]:
    """Return [bands]: strengths of a texture's bands, 0 where they do not matter."""
    pixels = texture.pixels[:COMPARED_TEXELS, :COMPARED_TEXELS]
    part = SourceTexture(texture.name, pixels, texture.pixel_hash, maps=texture.maps, map_weights=texture.map_weights)
    (sample,) = sample_textures([part], config, most=COMPARED_BLOCKS)
    with one_thread():
        squares = _mean_squares(sample.blocks, tables, config)
    rows = np.bincount(tables.bands, minlength=len(tables.energies))
    energies = band_energies(squares, tables.bands, len(rows)) / np.maximum(rows, 1)
    levels = 0.5 * SCALE_STEPS_PER_OCTAVE * np.log2(np.maximum(energies, LEAST_ENERGY))
    return np.asarray(np.maximum(levels - (levels.max() - FAINT_STEPS), 0.0) * np.sqrt(np.minimum(rows, 12)))


def _nearest_centres(points: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """[points] number of the nearest of `count` centres, by Lloyd's iteration from points that are far apart."""
    centres = points[:1]
    while len(centres) < count:
        distances = np.square(points[:, None] - centres).sum(2).min(1)
        centres = np.concatenate([centres, points[[int(distances.argmax())]]])
    for _ in range(SHARING_ROUNDS):
        chosen = np.square(points[:, None] - centres).sum(2).argmin(1)
        centres = np.stack([points[chosen == n].mean(0) if (chosen == n).any() else centres[n] for n in range(count)])
    return np.asarray(chosen, np.int64)
