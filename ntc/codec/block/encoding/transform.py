"""The transform of an encoder: a basis fitted to blocks, and projections of blocks to its coefficients.

The basis is a Karhunen-Loeve transform by channel: the principal directions of a channel's blocks (eigenvectors of their second
moments), of which the strongest of all channels are kept. Rows are stored in 8 bits, so they are orthogonal only nearly;
coefficients are therefore computed by least squares, with the inverse of the rows' Gram matrix. Rows of a plane lie together, and
those that coarse mips show come first.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Sample
from ntc.codec.block.model import BlockDecoder, averaged_rows
from ntc.codec.block.trellis import SCALE_ORIGIN, SCALE_STEPS_PER_OCTAVE, scale_values

Array = NDArray[np.float32]
LARGEST_NUMBER = 127.0
"""Largest number in a row of the basis."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Tables of a decoder in the form that the encoder computes with."""

    projections: "tuple[Projection, ...]"
    """Projections by channel."""
    depths: NDArray[np.uint8]
    """[sizes, modes, coefficients]."""
    scales: Array
    """[modes, coefficients] float32."""

    @classmethod
    def of(cls, decoder: BlockDecoder, config: BlockConfig) -> "Tables":
        """Return the tables of `decoder`."""
        return _tables(decoder, config)

    def project(self, blocks: Array) -> Array:
        """[blocks, coefficients] float32: the coefficients of least squared error of `blocks` [blocks, texels x channels]."""
        return projected(blocks, self.projections)


@lru_cache(maxsize=16)
def _tables(decoder: BlockDecoder, config: BlockConfig) -> Tables:
    projections = Basis(decoder.basis, decoder.channels, decoder.basis_scale).projections(config)
    return Tables(projections, decoder.depths(config), scale_values(decoder.scales).astype(np.float32))


@dataclass(frozen=True, eq=False)
class Basis:
    """Rows of a transform, as `BlockDecoder` stores them."""

    rows: NDArray[np.int8]
    channels: NDArray[np.uint8]
    scale: NDArray[np.uint8]

    def projections(self, config: BlockConfig) -> "tuple[Projection, ...]":
        """Return the projections of all channels under the rounded rows."""
        rows = self.rows.astype(np.float64) * scale_values(self.scale)[:, None]
        projections = []
        for channel in range(config.output_channels):
            rows_of_channel = np.nonzero(self.channels == channel)[0]
            # The rows are orthogonal but for their rounding.
            matrix = np.linalg.solve(rows[rows_of_channel] @ rows[rows_of_channel].T, rows[rows_of_channel]).T
            projections.append(Projection(rows_of_channel, matrix.astype(np.float32)))
        return tuple(projections)


class Projection(NamedTuple):
    """A matrix from a channel's texels to the coefficients of its rows."""

    rows: NDArray[np.int64]
    """[rows] numbers of the channel's coefficients."""
    matrix: Array
    """[texels, rows] float32: texels times this are the coefficients of least squared error."""


def projected(blocks: Array, projections: Sequence[Projection]) -> Array:
    """[blocks, coefficients] float32 of `blocks` [blocks, texels x channels]."""
    images = blocks.reshape(len(blocks), -1, len(projections))
    values = np.empty((len(blocks), sum(len(each.rows) for each in projections)), np.float32)
    for channel, projection in enumerate(projections):
        values[:, projection.rows] = np.ascontiguousarray(images[..., channel]) @ projection.matrix
    return values


def fitted_basis(samples: Sequence[Sample], config: BlockConfig) -> Basis:
    """Return the leading principal directions of each channel's blocks about 0, rounded to 8 bits.

    Each row is of one channel: correlations between channels differ from texture to texture.
    """
    blocks = np.concatenate([sample.blocks for sample in samples])
    images = blocks.reshape(-1, config.block_texels, config.output_channels)
    variances, vectors = [], []
    for channel in range(config.output_channels):
        values = images[..., channel].astype(np.float64)
        energies, directions = np.linalg.eigh(values.T @ values / len(values))
        variances.append(energies)
        vectors.append(directions.T)
    rows, variance = np.concatenate(vectors), np.concatenate(variances)
    return strongest_rows(rows, variance, config)[0]


def strongest_rows(
    rows: NDArray[np.float64], variance: NDArray[np.float64], config: BlockConfig
) -> tuple[Basis, NDArray[np.float64]]:
    """(a basis of the `rows` of greatest `variance`, rounded; their variances). `rows` [rows, texels] have a length of 1: those of the
    first channel, then those of the next."""
    strongest = np.argsort(-variance, kind="stable")[: config.coefficients]
    rows = rows[strongest] * np.where(rows[strongest].sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    channels = strongest // config.block_texels
    # Rows of a plane lie together; those come first that coarse mips show.
    plane = np.array([place for place, of_plane in enumerate(config.planes) for _ in of_plane])[_in_planes(config)]
    shown = np.square(averaged_rows(rows, config, config.mips - 1)).sum(1) * variance[strongest]
    order = np.lexsort((np.arange(len(strongest)), -shown, plane[channels]))
    whole = rows[order]
    largest = np.maximum(np.abs(whole).max(1) / LARGEST_NUMBER, 1e-6)
    scale = np.ceil(np.log2(largest) * SCALE_STEPS_PER_OCTAVE - 1e-9) + SCALE_ORIGIN
    stored = np.clip(scale, 0, 255).astype(np.uint8)
    rounded = np.clip(np.rint(whole / scale_values(stored)[:, None]), -LARGEST_NUMBER, LARGEST_NUMBER)
    return Basis(rounded.astype(np.int8), channels[order].astype(np.uint8), stored), variance[strongest][order]


def _in_planes(config: BlockConfig) -> NDArray[np.int64]:
    """[channels] place of each channel among those of all planes, one plane after the other."""
    return np.argsort([channel for plane in config.planes for channel in plane])


class _OneThread:
    """A limit of numpy's products to one thread in the whole process, which ends with its last user."""

    def __init__(self) -> None:
        self._lock, self._users = Lock(), 0
        self._limits: threadpool_limits | None = None

    def begin(self) -> None:
        with self._lock:
            self._users += 1
            if self._limits is None:
                self._limits = threadpool_limits(1, "blas")

    def end(self) -> None:
        with self._lock:
            self._users -= 1
            if self._limits is not None and not self._users:
                self._limits.restore_original_limits()
                self._limits = None


_ONE_THREAD = _OneThread()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit numpy's products to one thread: numbers do not depend on the number of cores, and other cores stay free."""
    _ONE_THREAD.begin()
    try:
        yield
    finally:
        _ONE_THREAD.end()
