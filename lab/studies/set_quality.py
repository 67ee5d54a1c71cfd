"""Quality of single decoded textures and of sets."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.quality import PsnrSummary, psnr_db, psnr_of_mse
from ntc.errors import InputError
from ntc.metrics.image_quality import flip, ssim
from ntc.metrics.metrics import psnr_table
from ntc.metrics.perceptual import has_jod, has_ssimulacra2, jod, ssimulacra2
from ntc.pack.file import write_pack

Size = tuple[int, int]


@dataclass(frozen=True)
class PictureQuality:
    """Quality of a decoded texture against its original: mip 0 over 8-bit values."""

    psnr_db: float
    """PSNR in dB. Equal textures count as if a single value differed by one step."""
    ssim: float
    flip: float | None
    """Mean FLIP; None where it was not measured."""
    ssimulacra2: float | None = None
    jod: float | None = None
    """ColorVideoVDP. It and SSIMULACRA2 are measured with FLIP, where their packages are installed."""


def picture_quality(truth: NDArray[np.uint8], decoded: NDArray[np.uint8], with_flip: bool = True) -> PictureQuality:
    """Return the quality of `decoded` against `truth` of equal shape. Raises InputError where FLIP is not installed."""
    return PictureQuality(
        min(psnr_db(decoded, truth), psnr_of_mse(1.0 / truth.size)),
        ssim(truth, decoded),
        flip(truth, decoded) if with_flip else None,
        ssimulacra2(truth, decoded) if with_flip and has_ssimulacra2() else None,
        jod(truth, decoded) if with_flip and has_jod() else None,
    )


@dataclass(frozen=True)
class SetQuality:
    """Quality and size of a set of textures."""

    bits_per_texel: float
    """Bits of everything that is stored, per texel of mip 0."""
    mean_db: float
    of_mean_mse_db: float
    """PSNR of the mean over textures of their mean square errors."""
    worst_db: float
    ssim: float
    flip: float | None
    """Mean FLIP of the measured textures; None without any."""
    seconds: float
    """Encoding time: CPU time, for codec `grid` wall time."""
    file_bits_per_texel: float | None = None
    """Bits of whole files per texel of mip 0; None for formats that are not files."""
    ssimulacra2: float | None = None
    jod: float | None = None
    """Mean of the measured textures."""

    @classmethod
    def of(
        cls,
        pictures: Sequence[PictureQuality],
        bits_per_texel: float,
        seconds: float,
        file_bits_per_texel: float | None = None,
    ) -> "SetQuality":
        """Return the means over `pictures`. Raises InputError without any."""
        summary = PsnrSummary.of([picture.psnr_db for picture in pictures])
        if summary is None:
            raise InputError("no texture to compare; name a scene or folder of images that are not constant")
        return cls(
            bits_per_texel,
            summary.mean_db,
            summary.of_mean_mse_db,
            summary.minimum_db,
            float(np.mean([picture.ssim for picture in pictures])),
            _mean([picture.flip for picture in pictures]),
            seconds,
            file_bits_per_texel,
            _mean([picture.ssimulacra2 for picture in pictures]),
            _mean([picture.jod for picture in pictures]),
        )


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean of the values that are not None; None without any."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def texel_count(sizes: Sequence[Size]) -> int:
    """Return the number of texels of mip 0 of textures of `sizes`, the denominator of bits per texel."""
    return sum(math.prod(size) for size in sizes)


def pack_file_bits_per_texel(pack: Pack) -> float:
    """Return the bits of a pack's file per texel of mip 0."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pack.ntc"
        write_pack(path, pack)
        stored = path.stat().st_size
    return 8.0 * stored / texel_count([(texture.width, texture.height) for texture in pack.textures])


def pack_bits_per_texel(pack: Pack) -> float:
    """Return the bits of latents, decoders and adapters per texel of mip 0."""
    table = psnr_table(pack)
    stored = table.latent_bytes + table.decoder_bytes + table.adapter_bytes
    return 8.0 * stored / texel_count([(texture.width, texture.height) for texture in pack.textures])
