"""How near each mip of an encoded texture is to the original's."""

from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture
from ntc.codec.torch_codec import TorchCodec
from ntc.errors import InputError
from ntc.metrics.metrics import psnr_db
from ntc.pack.model import Pack


def level_psnr(
    pack: Pack, texture_index: int, source: SourceTexture, codec: TorchCodec | None = None
) -> tuple[float, ...]:
    """PSNR in dB over 8-bit values of every latent level of a texture, finest first; infinity where equal.

    Level l as `codec` (None: one of `pack` on the CPU) decodes it, against mip l of `source`, which `pack` encodes.
    Raises InputError for a source of another size or with other channels.
    """
    encoded = pack.textures[texture_index]
    expected = (encoded.height, encoded.width, encoded.channels)
    if source.pixels.shape != expected:
        raise InputError(f"{source.name}: has shape {source.pixels.shape}; the pack has {expected}; encode it anew")
    codec = codec or TorchCodec(pack, "cpu")
    levels = len(latent_levels(encoded.width, encoded.height, pack.config))
    mips = mip_chain(source.pixels, source.color_space)[:levels]
    return tuple(psnr_db(codec.decode_image(texture_index, level), mip) for level, mip in enumerate(mips))
