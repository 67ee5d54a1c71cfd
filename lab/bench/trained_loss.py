"""Loss of PSNR of trained packs by precision, against the original images."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lab.bench.stability import StabilityBench
from ntc.codec.config import Precision
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from ntc.codec.textures import SourceTexture


@dataclass(frozen=True)
class TrainedLoss:
    """Loss of one trained pack in one precision, at texel centres of mip 0."""

    pack: str
    precision: Precision
    textures: int
    texels: int
    psnr_db: float
    """PSNR of float64 decoding against the images, the mean over textures."""
    mean_loss_db: float
    largest_loss_db: float
    """Largest loss of a texture; gains count as 0."""
    largest_error: float
    """Largest error against float64 decoding, in [0, 1]."""


def trained_loss(
    bench: StabilityBench,
    name: str,
    pack: Pack,
    images: Sequence[SourceTexture],
    precision: Precision,
    texels: int,
    seed: int = 0,
) -> TrainedLoss | None:
    """Return the loss over about `texels` texels of the textures that `images` has in the size of `pack`; None without any."""
    by_hash = {image.pixel_hash: image.pixels for image in images}
    random = np.random.default_rng(seed)
    decoder = bench.texel_decoder(pack, precision)
    each = max(256, texels // max(1, len(pack.textures)))
    exact_db, loss, largest = [], [], 0.0
    for index, texture in enumerate(pack.textures):
        pixels = by_hash.get(texture.pixel_hash)
        if pixels is None or pixels.shape[:2] != (texture.height, texture.width):
            continue
        x, y = random.integers(0, texture.width, each), random.integers(0, texture.height, each)
        uv = np.stack([(x + 0.5) / texture.width, (y + 0.5) / texture.height], axis=-1).astype(np.float32)
        truth = pixels[y, x, : texture.channels].astype(np.float64) / 255.0
        exact = decode_texels(pack, index, uv.astype(np.float64), np.zeros(each))
        decoded = decoder.decode_texels(index, uv, np.zeros(each)).astype(np.float64)
        largest = max(largest, float(np.abs(decoded - exact).max()))
        quality = [-10.0 * np.log10(np.mean((values - truth) ** 2) + 1e-12) for values in (exact, decoded)]
        exact_db.append(quality[0])
        loss.append(max(0.0, quality[0] - quality[1]))
    decoder.release()
    if not loss:
        return None
    return TrainedLoss(
        name, precision, len(loss), each * len(loss), float(np.mean(exact_db)), float(np.mean(loss)), max(loss), largest
    )
