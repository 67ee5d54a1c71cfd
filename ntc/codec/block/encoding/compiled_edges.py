"""Two colours for each block and indices between them, compiled by numba (`ntc.codec.block.encoding.edges`)."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

POWER_ROUNDS = 6
"""Of the iteration that finds a block's principal direction."""


@njit(nogil=True, cache=True)
def _covariance(block: NDArray[np.float32], squares: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the weighted covariance [channels, channels] of `block` [texels, channels], times texels."""
    texels, channels = block.shape
    mean = np.zeros(channels, np.float32)
    for texel in range(texels):
        mean += block[texel] / np.float32(texels)
    covariance = np.zeros((channels, channels), np.float32)
    for texel in range(texels):
        for one in range(channels):
            for other in range(channels):
                covariance[one, other] += (block[texel, one] - mean[one]) * (block[texel, other] - mean[other])
    for one in range(channels):
        for other in range(channels):
            covariance[one, other] *= np.sqrt(squares[one] * squares[other])
    return covariance


@njit(nogil=True, cache=True)
def _principal(block: NDArray[np.float32], squares: NDArray[np.float32], direction: NDArray[np.float32]) -> None:
    """Write about the direction of greatest weighted variance of `block` into `direction`, weighted once more."""
    covariance, channels = _covariance(block, squares), len(direction)
    following = np.zeros(channels, np.float32)
    for channel in range(channels):
        direction[channel] = covariance[channel].sum() + np.float32(1e-6)
    for _ in range(POWER_ROUNDS):
        length = np.float32(1e-12)
        for one in range(channels):
            following[one] = 0.0
            for other in range(channels):
                following[one] += covariance[one, other] * direction[other]
            length += following[one] * following[one]
        for one in range(channels):
            direction[one] = following[one] / np.sqrt(length)
    for channel in range(channels):
        direction[channel] *= np.sqrt(squares[channel])


@njit(nogil=True, cache=True)
def _extremes(block: NDArray[np.float32], direction: NDArray[np.float32], colours: NDArray[np.float32]) -> None:
    """Write the texels of `block` that lie farthest apart along `direction` into `colours` [2, channels]."""
    least, most = np.float32(np.inf), np.float32(-np.inf)
    for texel in range(block.shape[0]):
        place = np.float32(0.0)
        for channel in range(block.shape[1]):
            place += block[texel, channel] * direction[channel]
        if place < least:
            least = place
            colours[0] = block[texel]
        if place > most:
            most = place
            colours[1] = block[texel]


@njit(nogil=True, cache=True)
def _take_indices(
    block: NDArray[np.float32],
    squares: NDArray[np.float32],
    colours: NDArray[np.float32],
    largest: int,
    numbers: NDArray[np.uint8],
) -> float:
    """Round `colours`, write the index nearest to each texel into `numbers`, and return the weighted squared error."""
    channels = block.shape[1]
    length = np.float32(1e-9)
    for channel in range(channels):
        for one in range(2):
            colours[one, channel] = min(max(np.rint(colours[one, channel]), np.float32(0.0)), np.float32(255.0))
        step = colours[1, channel] - colours[0, channel]
        length += step * step * squares[channel]
    error = np.float32(0.0)
    for texel in range(block.shape[0]):
        share = np.float32(0.0)
        for channel in range(channels):
            step = colours[1, channel] - colours[0, channel]
            share += (block[texel, channel] - colours[0, channel]) * step * squares[channel]
        number = min(max(np.rint(share / length * largest), 0.0), float(largest))
        numbers[texel] = np.uint8(number)
        taken = np.float32(number / largest)
        for channel in range(channels):
            shown = colours[0, channel] + taken * (colours[1, channel] - colours[0, channel])
            error += (block[texel, channel] - shown) ** 2 * squares[channel]
    return float(error)


@njit(nogil=True, cache=True)
def _fit_colours(
    block: NDArray[np.float32], numbers: NDArray[np.uint8], largest: int, colours: NDArray[np.float32]
) -> None:
    """Write the colours of least squared error for these indices into `colours`, where they are determined."""
    first, both, second = 0.0, 0.0, 0.0
    for number in numbers:
        share = number / largest
        first += (1.0 - share) * (1.0 - share)
        both += (1.0 - share) * share
        second += share * share
    determinant = first * second - both * both
    if determinant <= 1e-4:
        return
    for channel in range(block.shape[1]):
        to_first, to_second = 0.0, 0.0
        for texel in range(block.shape[0]):
            share = numbers[texel] / largest
            to_first += (1.0 - share) * block[texel, channel]
            to_second += share * block[texel, channel]
        colours[0, channel] = (second * to_first - both * to_second) / determinant
        colours[1, channel] = (first * to_second - both * to_first) / determinant


@njit(nogil=True, cache=True)
def fit_two_colours(
    values: NDArray[np.float32],
    squares: NDArray[np.float32],
    largest: int,
    rounds: int,
    found: NDArray[np.uint8],
    indices: NDArray[np.uint8],
) -> None:
    """Write the best colours `found` [blocks, 2, channels] and `indices` [blocks, texels] from 0 to `largest` for `values` [blocks,
    texels, channels], whose squared errors are weighted by `squares` [channels].

    `rounds` alternations between indices and the colours that fit them."""
    texels, channels = values.shape[1:]
    direction = np.zeros(channels, np.float32)
    colours = np.zeros((2, channels), np.float32)
    numbers = np.zeros(texels, np.uint8)
    for block in range(len(values)):
        _principal(values[block], squares, direction)
        _extremes(values[block], direction, colours)
        best = np.inf
        for _ in range(rounds):
            error = _take_indices(values[block], squares, colours, largest, numbers)
            if error >= best:
                break
            best = error
            for one in range(2):
                for channel in range(channels):
                    found[block, one, channel] = np.uint8(colours[one, channel])
            indices[block] = numbers
            _fit_colours(values[block], numbers, largest, colours)
