"""Edge parts of a plane and what they cost in the derived mip, compiled by numba (`ntc.codec.block.encoding.edges`).

An edge part starts with the two texels that lie farthest apart along the block's principal direction, which a few power iterations
find. Then the index of each texel and the two colours are fitted in turn, as Lloyd's iteration does: nearest indices for the colours,
colours of least squared error for the indices (a 2x2 system), until the error no longer falls. Colours are rounded to 8 bits before
each error is measured, so the best stored pair wins. Values of a block lie by channel here, so that loops over its texels use the
processor's vectors."""

import numpy as np
from numba import boolean, float32, int64, uint8
from numpy.typing import NDArray

from ntc.codec.compiling import Signatures, compiled_loop

POWER_ROUNDS = 6
"""Power iterations that approximate a block's principal direction."""
SUMS_IN_ANY_ORDER = {"reassoc", "contract"}
"""Permission for the compiler to reorder sums, so that it uses vectors. One machine gives the same bytes with any threads."""


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _covary(
    values: NDArray[np.float32], squares: NDArray[np.float32], mean: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Write the weighted covariance of `values` [channels, texels], times texels, into `out` [channels, channels].

    `mean` [channels] is scratch."""
    channels, texels = values.shape
    for one in range(channels):
        total = np.float32(0.0)
        for texel in range(texels):
            total += values[one, texel]
        mean[one] = total / np.float32(texels)
        for other in range(one + 1):
            total = np.float32(0.0)
            for texel in range(texels):
                total += (values[one, texel] - mean[one]) * (values[other, texel] - mean[other])
            out[one, other] = out[other, one] = total * np.sqrt(squares[one] * squares[other])


@compiled_loop()
def _turn_to_principal(covariance: NDArray[np.float32], direction: NDArray[np.float32]) -> None:
    """Write about the direction of greatest variance into `direction` [channels]."""
    channels = len(direction)
    following = np.zeros(channels, np.float32)
    for one in range(channels):
        direction[one] = covariance[one].sum() + np.float32(1e-6)
    for _ in range(POWER_ROUNDS):
        length = np.float32(1e-12)
        for one in range(channels):
            following[one] = 0.0
            for other in range(channels):
                following[one] += covariance[one, other] * direction[other]
            length += following[one] * following[one]
        for one in range(channels):
            direction[one] = following[one] / np.sqrt(length)


@compiled_loop()
def _extremes(
    values: NDArray[np.float32], direction: NDArray[np.float32], place: NDArray[np.float32], ends: NDArray[np.float32]
) -> None:
    """Write the texels of `values` that lie farthest apart along `direction` into `ends` [2, channels].

    `place` [texels] is scratch."""
    channels, texels = values.shape
    place[:] = 0.0
    for channel in range(channels):
        for texel in range(texels):
            place[texel] += values[channel, texel] * direction[channel]
    least, most = 0, 0
    for texel in range(1, texels):
        if place[texel] < place[least]:
            least = texel
        if place[texel] > place[most]:
            most = texel
    for channel in range(channels):
        ends[0, channel], ends[1, channel] = values[channel, least], values[channel, most]


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _take_indices(
    values: NDArray[np.float32],
    squares: NDArray[np.float32],
    largest: np.float32,
    ends: NDArray[np.float32],
    numbers: NDArray[np.float32],
) -> float:
    """Round `ends`, write the index nearest to each texel into `numbers`, and return the weighted squared error."""
    channels, texels = values.shape
    length = np.float32(1e-9)
    for channel in range(channels):
        for one in range(2):
            ends[one, channel] = min(max(np.rint(ends[one, channel]), np.float32(0.0)), np.float32(255.0))
        step = ends[1, channel] - ends[0, channel]
        length += step * step * squares[channel]
    half = np.float32(0.5)
    for texel in range(texels):
        numbers[texel] = half
    for channel in range(channels):
        first, scale = ends[0, channel], (ends[1, channel] - ends[0, channel]) * squares[channel] * largest / length
        for texel in range(texels):
            numbers[texel] += (values[channel, texel] - first) * scale
    for texel in range(texels):
        numbers[texel] = np.float32(np.int32(min(max(numbers[texel], half), largest + half)))
    error = np.float32(0.0)
    for channel in range(channels):
        first, step = ends[0, channel], (ends[1, channel] - ends[0, channel]) / largest
        missed = np.float32(0.0)
        for texel in range(texels):
            difference = values[channel, texel] - first - numbers[texel] * step
            missed += difference * difference
        error += missed * squares[channel]
    return float(error)


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _fit_ends(
    values: NDArray[np.float32], numbers: NDArray[np.float32], largest: np.float32, ends: NDArray[np.float32]
) -> None:
    """Write the colours of least squared error for these indices into `ends`, where they are determined."""
    channels, texels = values.shape
    sums, squares = np.float32(0.0), np.float32(0.0)
    for texel in range(texels):
        sums += numbers[texel]
        squares += numbers[texel] * numbers[texel]
    second = squares / (largest * largest)
    both = sums / largest - second
    first = np.float32(texels) - both - sums / largest
    determinant = first * second - both * both
    if determinant <= np.float32(1e-4):
        return
    for channel in range(channels):
        whole, to_second = np.float32(0.0), np.float32(0.0)
        for texel in range(texels):
            whole += values[channel, texel]
            to_second += values[channel, texel] * numbers[texel]
        to_second /= largest
        to_first = whole - to_second
        ends[0, channel] = (second * to_first - both * to_second) / determinant
        ends[1, channel] = (first * to_second - both * to_first) / determinant


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _fit(
    values: NDArray[np.float32],
    squares: NDArray[np.float32],
    largest: np.float32,
    rounds: int,
    scratch: NDArray[np.float32],
    colours: NDArray[np.uint8],
    indices: NDArray[np.uint8],
) -> None:
    """Write the best `colours` [2, channels] and `indices` [texels] for `values` [channels, texels] in steps of 8 bits."""
    channels, texels = values.shape
    ends, direction, covariance = scratch[:2, :channels], scratch[2, :channels], scratch[3 : 3 + channels, :channels]
    numbers = scratch[3 + channels, :texels]
    _covary(values, squares, direction, covariance)
    _turn_to_principal(covariance, direction)
    for channel in range(channels):
        direction[channel] *= np.sqrt(squares[channel])
    _extremes(values, direction, numbers, ends)
    best = np.inf
    for _ in range(rounds):
        error = _take_indices(values, squares, largest, ends, numbers)
        if error >= best:
            break
        best = error
        for channel in range(channels):
            colours[0, channel], colours[1, channel] = np.uint8(ends[0, channel]), np.uint8(ends[1, channel])
        for texel in range(texels):
            indices[texel] = np.uint8(numbers[texel])
        _fit_ends(values, numbers, largest, ends)


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _turned(
    block: NDArray[np.float32],
    mean: NDArray[np.float32],
    matrix: NDArray[np.float32],
    channels: NDArray[np.int64],
    scratch: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write `mean` + `matrix` times the `channels` of `block` [texels, channels of the codec] into `out` [channels, texels], and these
    channels into `scratch`, which is as large."""
    for one in range(len(channels)):
        for texel in range(out.shape[1]):
            scratch[one, texel] = block[texel, channels[one]]
    for one in range(len(channels)):
        for texel in range(out.shape[1]):
            out[one, texel] = mean[one]
        for other in range(len(channels)):
            factor = matrix[one, other]
            for texel in range(out.shape[1]):
                out[one, texel] += factor * scratch[other, texel]


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def fit_plane(
    blocks: NDArray[np.float32],
    channels: NDArray[np.int64],
    mean: NDArray[np.float32],
    axes: NDArray[np.float32],
    inverse: NDArray[np.float32],
    squares: NDArray[np.float32],
    largest: int,
    rounds: int,
    colours: NDArray[np.uint8],
    indices: NDArray[np.uint8],
    rest: NDArray[np.float32],
) -> None:
    """Write edge parts of the plane that has `channels`, and what they leave, for normalised `blocks` [blocks, texels, channels].

    `mean` [plane], `axes` and `inverse` [plane, plane] are those of the plane; `colours` [blocks, 2, plane], `indices` [blocks,
    texels]; `rest` as `blocks`, of which only the plane's channels are written."""
    texels, count = blocks.shape[1], len(channels)
    scratch = np.zeros((4 + count, max(texels, count)), np.float32)
    values, missed = np.zeros((count, texels), np.float32), np.zeros((count, texels), np.float32)
    to_steps = np.float32(255.0)
    for block in range(len(blocks)):
        _turned(blocks[block], mean, axes, channels, missed, values)
        for one in range(count):
            for texel in range(texels):
                values[one, texel] *= to_steps
        _fit(values, squares, np.float32(largest), rounds, scratch, colours[block], indices[block])
        for one in range(count):
            first = np.float32(colours[block, 0, one])
            step = (np.float32(colours[block, 1, one]) - first) / np.float32(largest)
            for texel in range(texels):
                shown = first + step * np.float32(indices[block, texel])
                missed[one, texel] = (values[one, texel] - shown) / to_steps
        for one in range(count):
            place = channels[one]
            for texel in range(texels):
                rest[block, texel, place] = 0.0
            for other in range(count):
                factor = inverse[other, one]
                if factor != 0.0:
                    for texel in range(texels):
                        rest[block, texel, place] += missed[other, texel] * factor


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _halve(values: NDArray[np.float32], side: int, out: NDArray[np.float32]) -> None:
    """Write the averages of 2x2 of `values` [side x side] into `out` [side / 2 x side / 2]."""
    half, quarter = side // 2, np.float32(0.25)
    for row in range(half):
        for column in range(half):
            upper = 2 * row * side + 2 * column
            lower = upper + side
            out[row * half + column] = quarter * (
                (values[upper] + values[upper + 1]) + (values[lower] + values[lower + 1])
            )


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _take_part(
    colours: NDArray[np.uint8],
    share: NDArray[np.float32],
    variance: NDArray[np.float32],
    by_squares: NDArray[np.bool_],
    missed: NDArray[np.float32],
) -> None:
    """Subtract from `missed` [channels, texels] what an edge part of `colours` [2, channels] shows, where texels take this `share` of
    the second one, with this `variance` (`reference.edge_values`)."""
    scale = np.float32(1.0 / 255.0)
    for channel in range(len(missed)):
        first = np.float32(colours[0, channel]) * scale
        step = np.float32(colours[1, channel]) * scale - first
        for texel in range(missed.shape[1]):
            value = first + step * share[texel]
            if by_squares[channel]:
                value = np.sqrt(value * value + step * step * variance[texel])
            missed[channel, texel] -= value


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def _share_of(
    indices: NDArray[np.uint8], side: int, largest: int, scratch: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Write the mean and the variance of 2x2 `indices` [side x side], in units of `largest`, into `out` [2, texels]."""
    for power in range(2):
        for texel in range(len(indices)):
            share = np.float32(indices[texel]) / np.float32(largest)
            scratch[texel] = share * share if power else share
        _halve(scratch, side, out[power])
    for texel in range(out.shape[1]):
        out[1, texel] = max(out[1, texel] - out[0, texel] * out[0, texel], np.float32(0.0))


@compiled_loop(fastmath=SUMS_IN_ANY_ORDER)
def add_derived(
    blocks: NDArray[np.float32],
    rest: NDArray[np.float32],
    side: int,
    channels: NDArray[np.int64],
    means: NDArray[np.float32],
    axes: NDArray[np.float32],
    inverse: NDArray[np.float32],
    by_squares: NDArray[np.bool_],
    largest: int,
    colours: NDArray[np.uint8],
    indices: NDArray[np.uint8],
    costs: NDArray[np.float32],
) -> None:
    """Add to `costs` [blocks] the squared error of the next mip in the plane that has `channels`, if the transform shows `rest`.

    `blocks` and `rest` [blocks, texels, channels], normalised, blocks of `side` texels along a side; `means` [2, plane] of both mips;
    `by_squares` [plane]: which channels average squares. `largest` 0: the plane has no edge parts, and `colours` and `indices` are not
    read."""
    texels, count = blocks.shape[1], len(channels)
    values, missed = np.zeros((count, texels), np.float32), np.zeros((count, texels // 4), np.float32)
    scratch, left, share = (
        np.zeros((count, texels), np.float32),
        np.zeros(texels // 4, np.float32),
        np.zeros((2, texels // 4), np.float32),
    )
    for block in range(len(blocks)):
        _turned(blocks[block], means[0], axes, channels, scratch, values)
        for one in range(count):
            if by_squares[one]:
                for texel in range(texels):
                    values[one, texel] *= values[one, texel]
            _halve(values[one], side, missed[one])
            for texel in range(texels // 4):
                shown = np.float32(0.0) if largest else means[1, one]
                truth = missed[one, texel]
                missed[one, texel] = (np.sqrt(truth) if by_squares[one] else truth) - shown
        if largest:
            _share_of(indices[block], side, largest, scratch[0], share)
            _take_part(colours[block], share[0], share[1], by_squares, missed)
        total = np.float32(0.0)
        for one in range(count):
            for texel in range(texels):
                scratch[0, texel] = rest[block, texel, channels[one]]
            _halve(scratch[0], side, left)
            for other in range(count):
                for texel in range(texels // 4):
                    left[texel] -= missed[other, texel] * inverse[other, one]
            for texel in range(texels // 4):
                total += left[texel] * left[texel]
        costs[block] += total


SIGNATURES: Signatures = {
    fit_plane: (
        float32[:, :, ::1],
        int64[::1],
        float32[::1],
        float32[:, ::1],
        float32[:, ::1],
        float32[::1],
        int64,
        int64,
        uint8[:, :, ::1],
        uint8[:, ::1],
        float32[:, :, ::1],
    ),
    add_derived: (
        float32[:, :, ::1],
        float32[:, :, ::1],
        int64,
        int64[::1],
        float32[:, ::1],
        float32[:, ::1],
        float32[:, ::1],
        boolean[::1],
        int64,
        uint8[:, :, ::1],
        uint8[:, ::1],
        float32[::1],
    ),
}
