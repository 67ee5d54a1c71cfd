"""What training found for a texture, as packs hold it."""

from ntc.codec.quantize import QuantizedLatents
from ntc.codec.textures import SourceTexture
from ntc.pack.model import Adapter, EncodedTexture


def encoded_texture(
    source: SourceTexture, group: int, latents: QuantizedLatents, adapter: Adapter | None
) -> EncodedTexture:
    """`source` in `group`, encoded as `latents` and, where the codec has them, `adapter`; its PSNR is not yet known."""
    width, height = source.size
    return EncodedTexture(
        name=source.name,
        pixel_hash=source.pixel_hash,
        width=width,
        height=height,
        channels=source.pixels.shape[2],
        color_space=source.color_space,
        wrap=source.wrap,
        category=source.category,
        group=group,
        latents=latents.stored,
        scale=latents.scale,
        offset=latents.offset,
        adapter=adapter,
    )
