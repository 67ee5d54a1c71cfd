"""Rate curves of textures that miss a limit of PSNR, to say how many bits they need."""

import hashlib
from dataclasses import fields

from ntc.codec.encoding import texture_set
from ntc.codec.model import Pack
from ntc.codec.textures import SourceTexture
from ntc.content_cache import ContentCache
from viewer.training.rates import RATE_CODEC, PointJob, RateCurve, RatePoint, rate_point

BITS = (1.0, 2.0, 4.0, 8.0)
"""Bits per texel of the points of a curve."""
MOST_CURVES = 6
"""Most textures with a curve: those that miss their limits by most."""
LARGEST_TEXELS = 1 << 20
"""Most texels of a texture with a curve: a larger one would take longer than the check."""


def rate_curve(source: SourceTexture, pack: Pack, cache: ContentCache) -> RateCurve | None:
    """Return the rate curve of a texture in the codec of `pack`; None for codecs without a target bitrate, and for large textures."""
    width, height = source.size
    if pack.config.kind != RATE_CODEC or width * height > LARGEST_TEXELS:
        return None
    facts = repr(
        (source.pixel_hash, source.size, source.maps, RATE_CODEC, BITS, [field.name for field in fields(RatePoint)])
    )
    content = f"curve-{hashlib.sha256(facts.encode()).hexdigest()[:40]}"
    curve = cache.read_value(content, RateCurve)
    if curve is None:
        whole = texture_set([source], 1)
        curve = RateCurve(tuple(rate_point(PointJob(source, whole, bits)) for bits in BITS), width * height)
        cache.write_value(content, curve)
    return curve
