"""Comparison of slots A and B in one picture: figures, histogram, errors of textures and decoders.

`compare` needs no OpenGL. It runs in a separate process."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb8
from ntc.codec.quality import psnr_of_mse
from ntc.errors import InputError
from ntc.metrics.image_quality import flip_map, ssim_map
from ntc.metrics.perceptual import has_jod, has_ssimulacra2, jod, ssimulacra2
from viewer.render.resources.layout import materials_of, texture_ids_of
from viewer.state.view_state import REFERENCE, ViewState, is_image_source

STEPS = 256
"""Number of different values of |A - B| in steps of 8-bit sRGB."""


@dataclass(frozen=True, eq=False)
class PicturePair:
    """Pictures of A and B as read from the GPU, with row 0 at the bottom."""

    size: tuple[int, int]
    """Size (width, height) in pixels."""
    a: bytes
    """Pixels of A: linear RGBA."""
    b: bytes
    a_type: str
    """NumPy type of a channel of `a`, such as `<f2`."""
    b_type: str
    ids: bytes
    """First words of the visibility buffer: one uint32 per pixel."""
    decoders: tuple[int, ...]
    """Decoder of each texture of the scene, -1 where nothing is decoded."""


@dataclass(frozen=True)
class ErrorRow:
    """Error of A against B over the pixels of one texture, or of the textures of one decoder, in steps of 8-bit sRGB."""

    number: int
    """Number of the texture or decoder."""
    decoder: int
    """Decoder of the texture; -1 where nothing is decoded."""
    pixels: int
    psnr_db: float
    """PSNR in dB; infinite where A and B are equal."""
    rmse: float
    mean: float
    """Mean of |A - B| over pixels and channels."""
    largest: int


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of A with B, the result of `compare`. Figures are None where no pixel is covered."""

    pixels: int
    """Number of covered pixels. All figures are over these."""
    psnr_db: float | None
    """PSNR in dB over 8-bit sRGB."""
    ssim: float | None
    """Mean SSIM of the windows on covered pixels."""
    flip: float | None
    """Mean FLIP over covered pixels; None also where FLIP cannot be computed."""
    flip_map: NDArray[np.float32] | None
    """FLIP map [H, W], 0 to 1, row 0 on top."""
    problem: str
    """Reason why FLIP cannot be computed; "" where it can."""
    histogram: NDArray[np.int64]
    """Covered pixels by |A - B| of red, green and blue in steps of 8-bit sRGB: [3, 256]."""
    textures: tuple[ErrorRow, ...]
    """Errors of visible textures, by id."""
    decoders: tuple[ErrorRow, ...]
    """Errors of visible decoders, by number."""
    ssimulacra2: float | None = None
    jod: float | None = None
    """SSIMULACRA2 and ColorVideoVDP of the whole picture; None where their packages are not installed."""


@dataclass(frozen=True, eq=False)
class LiveFigures:
    """Latest comparison of A and B for panels, and its state."""

    comparison: Comparison | None = None
    """Latest comparison."""
    is_current: bool = False
    """True where the comparison is of the shown picture."""
    computing: bool = False
    source: str = REFERENCE
    """Source of the decoders in `comparison.decoders`: slot A's, else slot B's."""
    problem: str = ""
    """Error that ended the comparison; "" without one."""


def compared_source(view: ViewState) -> str:
    """Return the source whose decoders list the errors: slot A's, or slot B's where A shows images."""
    return view.slot_b.source if is_image_source(view.slot_a.source) else view.slot_a.source


def _srgb8(pixels: bytes, kind: str, size: tuple[int, int]) -> NDArray[np.uint8]:
    values = np.frombuffer(pixels, kind).reshape(size[1], size[0], 4)[::-1, :, :3]
    return linear_to_srgb8(values.astype(np.float32))


def _rows(numbers: NDArray[np.intp], decoders: Sequence[int], difference: NDArray[np.int64]) -> tuple[ErrorRow, ...]:
    """Return a row for each number that occurs in `numbers` [N]; `difference` [N, 3] is |A - B|, `decoders` is by number."""
    count = len(decoders)
    pixels = np.bincount(numbers, minlength=count)
    squares = np.bincount(numbers, (difference * difference).sum(axis=1), count)
    sums = np.bincount(numbers, difference.sum(axis=1), count)
    largest = np.zeros(count, np.int64)
    np.maximum.at(largest, numbers, difference.max(axis=1))
    rows = []
    for number in np.nonzero(pixels)[0].tolist():
        samples = 3 * int(pixels[number])
        mean_square = float(squares[number]) / samples
        rows.append(
            ErrorRow(
                number=number,
                decoder=decoders[number],
                pixels=int(pixels[number]),
                psnr_db=psnr_of_mse(mean_square),
                rmse=mean_square**0.5,
                mean=float(sums[number]) / samples,
                largest=int(largest[number]),
            )
        )
    return tuple(rows)


def compare(pair: PicturePair) -> Comparison:
    """Compare two pictures of one view. Half a million pixels take about a second, mostly for FLIP."""
    a, b = _srgb8(pair.a, pair.a_type, pair.size), _srgb8(pair.b, pair.b_type, pair.size)
    words = np.frombuffer(pair.ids, "<u4").reshape(pair.size[1], pair.size[0])[::-1]
    covered = materials_of(words) >= 0
    pixels = int(covered.sum())
    if pixels == 0:
        nothing = np.zeros((3, STEPS), np.int64)
        return Comparison(0, None, None, None, None, "", nothing, (), ())
    difference = np.abs(a[covered].astype(np.int64) - b[covered])
    histogram = np.stack([np.bincount(difference[:, channel], minlength=STEPS) for channel in range(3)])
    ids = texture_ids_of(words)[covered].astype(np.intp)
    textured = ids >= 0
    textures = _rows(ids[textured], pair.decoders, difference[textured])
    pixel_decoders = np.array([*pair.decoders, -1], np.intp)[ids]
    decoded = pixel_decoders >= 0
    most = max(pair.decoders, default=-1) + 1
    decoders = _rows(pixel_decoders[decoded], range(most), difference[decoded])
    errors, problem = None, ""
    try:
        errors = flip_map(a, b)
    except InputError as error:
        problem = str(error)
    return Comparison(
        pixels=pixels,
        psnr_db=psnr_of_mse(float((difference * difference).mean())),
        ssim=float(ssim_map(a, b)[covered].mean()),
        flip=float(errors[covered].mean(dtype=np.float64)) if errors is not None else None,
        flip_map=errors,
        problem=problem,
        histogram=histogram,
        textures=textures,
        decoders=decoders,
        ssimulacra2=ssimulacra2(b, a) if has_ssimulacra2() else None,
        jod=jod(b, a) if has_jod() else None,
    )
