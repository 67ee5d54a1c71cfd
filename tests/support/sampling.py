"""glTF samplers in numpy, written after OpenGL 4.3, Sec. 8.14: what a texture fetch must give."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.bench.filtering import selected_lod, wrapped
from ntc.codec.mips import mip_chain, srgb_to_linear
from viewer.scene.model import Sampler

Array = NDArray[np.float64]


def fetch(mip: NDArray[np.floating[Any]], uv: Array, sampler: Sampler, linear: bool) -> Array:
    """[N, C] of one mip [h, w, C] at `uv` [N, 2], by nearest texel or bilinear."""
    height, width = mip.shape[:2]
    at = uv * (width, height)

    def texel(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
        return mip[wrapped(row, height, sampler.wrap[1]), wrapped(column, width, sampler.wrap[0])].astype(np.float64)

    if not linear:
        column, row = np.floor(at).astype(np.int64).T
        return texel(column, row)
    corner = np.floor(at - 0.5).astype(np.int64)
    x, y = (at - 0.5 - corner).T[:, :, None]
    column, row = corner.T
    upper = texel(column, row) * (1.0 - x) + texel(column + 1, row) * x
    lower = texel(column, row + 1) * (1.0 - x) + texel(column + 1, row + 1) * x
    return upper * (1.0 - y) + lower * y


def sample(pixels: NDArray[np.uint8], uv: Array, lod: float, sampler: Sampler) -> Array:
    """[N, 3] float64 linear light of `pixels` [H, W, 3] sRGB at `uv` [N, 2] and one `lod`."""
    return sample_chain([srgb_to_linear(mip / 255.0) for mip in mip_chain(pixels, "srgb")], uv, lod, sampler)


def sample_chain(chain: Sequence[NDArray[np.floating[Any]]], uv: Array, lod: float, sampler: Sampler) -> Array:
    """[N, 3] float64 of mips [h, w, 3] in linear light at `uv` [N, 2] and one `lod`."""
    selected, linears = selected_lod(np.array([lod]), sampler, len(chain))
    level, linear = min(float(selected[0]), len(chain) - 1.0), bool(linears[0])
    lower = int(level)
    upper = min(lower + 1, len(chain) - 1)
    share = level - lower
    return fetch(chain[lower], uv, sampler, linear) * (1.0 - share) + fetch(chain[upper], uv, sampler, linear) * share
