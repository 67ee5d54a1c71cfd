"""The images of a glTF texture as a pack decodes them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.latents import latent_levels
from ntc.codec.maps import SRGB_MAPS
from ntc.codec.mips import coded_z, mip_chain
from ntc.codec.model import Pack
from viewer.export.gltf.options import PackedTextureOption
from viewer.scene.gltf.packed_textures import NO_CHANNEL

Pixels = NDArray[np.uint8]
LevelDecoder = Callable[[int, int], Pixels]
"""(texture of the pack, level) -> [h, w, channels] uint8."""
OPAQUE = 255
LEVELS_KEPT = 16


def resized(pixels: Pixels, width: int, height: int) -> Pixels:
    """[height, width, C]: `pixels` [H, W, C] averaged over areas."""
    if pixels.shape[:2] == (height, width):
        return pixels
    channels = [
        Image.fromarray(pixels[..., k]).resize((width, height), Image.Resampling.BOX) for k in range(pixels.shape[2])
    ]
    return np.dstack([np.asarray(channel) for channel in channels])


@dataclass(frozen=True)
class DecodedImage:
    """An image of the scene: what the pack holds of it decoded, the rest from the original."""

    pack: Pack
    option: PackedTextureOption
    original: Callable[[], Pixels | None]
    """[H, W, 3 or 4]; None where there is none."""

    @property
    def srgb(self) -> bool:
        """Whether it holds colours in sRGB."""
        return bool(SRGB_MAPS.intersection(name for _, name in self.option.references))

    @property
    def is_normal(self) -> bool:
        """Whether it holds normals, whose z follows from x and y."""
        return any(name == "normal" for _, name in self.option.references)

    @property
    def components(self) -> list[int]:
        """Those of the image that the pack holds."""
        held = [k for k, channel in enumerate(self.option.channels) if channel != NO_CHANNEL]
        return [0, 1, 2] if self.is_normal else held

    def mips(self, decode: LevelDecoder, original: Pixels | None, all_levels: bool) -> list[Pixels]:
        """Return the largest level that the pack has, or the full pyramid below it: [h, w, 3], or 4 where `original` has alpha.

        Levels that the pack lacks are averaged from its smallest one.
        """
        layer = self.option.layer
        texture = self.pack.textures[layer]
        levels = latent_levels(texture.width, texture.height, self.pack.config)
        found = [self._composed(decode(layer, number), original) for number in range(len(levels) if all_levels else 1)]
        return found + self._smaller(found[-1]) if all_levels else found

    def _smaller(self, pixels: Pixels) -> list[Pixels]:
        """Return the mips below `pixels` [h, w, C], down to 1x1."""
        mips = list(mip_chain(pixels, "srgb" if self.srgb else "linear")[1:])
        if self.is_normal:
            for mip in mips:
                mip[..., 2:3] = coded_z(mip[..., :2])
        return mips

    def _composed(self, decoded: Pixels, original: Pixels | None) -> Pixels:
        height, width = decoded.shape[:2]
        channels = original.shape[2] if original is not None else 3
        whole = np.full((height, width, channels), OPAQUE, np.uint8)
        if original is not None:
            whole[:] = resized(original, width, height)
        for component, channel in enumerate(self.option.channels[:channels]):
            if channel != NO_CHANNEL:
                whole[..., component] = decoded[..., channel]
        if self.is_normal:
            whole[..., 2:3] = coded_z(whole[..., :2])
        return whole


def torch_decoder(pack: Pack) -> LevelDecoder:
    """Decodes levels of `pack` on the processor, many texels at once."""
    from ntc.codec.registry import codec_of

    codec = codec_of(pack.config).torch_twin(pack, "cpu")
    # A material set is asked for once for each of its images.
    return lru_cache(LEVELS_KEPT)(codec.decode_image)
