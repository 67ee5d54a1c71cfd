"""Rate curves of textures that miss a limit of PSNR: how many bits would mend them."""

import hashlib
from typing import cast

import msgspec

from ntc.api import encode
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import CodecName, codec_named, kind_in_file
from ntc.codec.textures import SourceTexture
from ntc.metrics.metrics import bits_with_mips
from viewer.checking.kept_values import KeptValues

BITS = (1.0, 2.0, 4.0, 8.0)
"""Bits per texel of the points of a curve."""
MOST_CURVES = 6
"""Textures whose curve is made: those that miss their limits by most."""
LARGEST_TEXELS = 1 << 20
"""Larger textures get no curve: it would take longer than the check."""


class RatePoint(msgspec.Struct, frozen=True):
    """A texture encoded alone at some bits."""

    bits_per_texel: float
    """Stored bits per texel of mip 0, tables and mips included."""
    psnr_db: dict[str, float | None]
    """PSNR in dB by map; None where it is exact."""


class RateCurve(msgspec.Struct, frozen=True):
    """A texture at rising bits."""

    points: tuple[RatePoint, ...]

    def bits_for(self, map_name: str, psnr_db: float) -> float | None:
        """Return the bits per texel at which a map reaches `psnr_db`, between the points by a line; None beyond the last one."""
        before: tuple[float, float] | None = None
        for point in self.points:
            quality = point.psnr_db.get(map_name)
            if quality is None:
                return point.bits_per_texel
            if quality >= psnr_db:
                if before is None or quality <= before[1]:
                    return point.bits_per_texel
                share = (psnr_db - before[1]) / (quality - before[1])
                return before[0] + share * (point.bits_per_texel - before[0])
            before = point.bits_per_texel, quality
        return None


def rate_curve(source: SourceTexture, pack: Pack, kept: KeptValues) -> RateCurve | None:
    """Return the curve of a texture in the codec of `pack`; None where the codec takes no target, and for large textures."""
    codec_name = kind_in_file(pack.config.kind)
    takes_no_target = codec_named(codec_name).refusals(EncodingChoices(target=BitsTarget(BITS[0])))
    if takes_no_target or source.size[0] * source.size[1] > LARGEST_TEXELS:
        return None
    facts = repr((source.pixel_hash, source.size, source.maps, codec_name, BITS))
    content = f"curve-{hashlib.sha256(facts.encode()).hexdigest()[:40]}"
    found = kept.read(content, RateCurve)
    if found is None:
        found = RateCurve(tuple(_point(source, codec_name, bits) for bits in BITS))
        kept.write(content, found)
    return found


def _point(source: SourceTexture, codec_name: str, bits: float) -> RatePoint:
    pack = encode([source], codec=cast(CodecName, codec_name), target=BitsTarget(bits))
    texture = pack.textures[0]
    psnr = texture.map_psnr_db or (texture.psnr_db,)
    quality = {str(name): finite_or_none(own) for name, own in zip(texture.maps, psnr, strict=False)}
    return RatePoint(bits_with_mips(pack), quality)
