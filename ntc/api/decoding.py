"""Decoding textures of a pack to arrays, to torch and to OpenGL."""

from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import latent_levels
from ntc.codec.maps import MapName, map_slices
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image
from ntc.errors import InputError

if TYPE_CHECKING:
    import torch

SRGB8_ALPHA8 = 0x8C43
"""Internal format of OpenGL: 8-bit RGB that is decoded from sRGB when it is read, and linear alpha."""
RGBA8 = 0x8058
"""Internal format of OpenGL: 8-bit RGBA that is read as it is."""


class UploadedTexture(Protocol):
    """The attributes of moderngl.Texture that are used."""

    def build_mipmaps(self, base: int = ..., max_level: int = ...) -> None: ...

    def write(self, data: Any, viewport: Any = ..., *, level: int = ...) -> None: ...


Uploaded_co = TypeVar("Uploaded_co", bound=UploadedTexture, covariant=True)


class TextureMaker(Protocol[Uploaded_co]):
    """The methods of moderngl.Context that are used."""

    def texture(
        self, size: tuple[int, int], components: int, data: Any = ..., *, internal_format: int | None = ...
    ) -> Uploaded_co: ...


def mip_count(pack: Pack, texture: int) -> int:
    """Mips that the pack holds of texture number `texture`, the largest one included."""
    own = pack.textures[_checked(pack, texture, 0)]
    return len(latent_levels(own.width, own.height, pack.config))


def _checked(pack: Pack, texture: int, level: int) -> int:
    """Return the index `texture`, checked: the pack has it with a mip `level`. Raises InputError."""
    if not 0 <= texture < len(pack.textures):
        raise InputError(f"{pack.name}: has no texture {texture}; it has 0 to {len(pack.textures) - 1}")
    own = pack.textures[texture]
    levels = len(latent_levels(own.width, own.height, pack.config))
    if not 0 <= level < levels:
        raise InputError(f"{pack.name}: texture {texture} has no mip {level}; it has 0 to {levels - 1}")
    return texture


def decode(pack: Pack, texture: int, level: int = 0, backend: Literal["numpy", "torch"] = "numpy") -> NDArray[np.uint8]:
    """Return [h, w, channels] uint8: mip `level` of a texture, in its colour space, the channels of its maps side by side.

    `numpy` is the float64 reference, `torch` its float32 twin, which is faster for codec `grid`. Raises InputError for a texture
    or a mip that is not there.
    """
    _checked(pack, texture, level)
    if backend == "numpy":
        return decode_image(pack, texture, level)
    from ntc.codec.registry import codec_of

    return np.asarray(codec_of(pack.config).torch_twin(pack, "cpu").decode_image(texture, level))


def decode_maps(pack: Pack, texture: int, level: int = 0) -> dict[MapName, NDArray[np.uint8]]:
    """Decode mip `level` of a texture map by map: [h, w, C] uint8 each, as from `decode`. A single texture has the map `base`
    alone."""
    own, pixels = pack.textures[_checked(pack, texture, level)], decode(pack, texture, level)
    return {name: pixels[..., place] for name, place in map_slices(own.maps, own.channels).items()}


def decode_to_torch(pack: Pack, texture: int, level: int = 0, device: str = "cpu") -> "torch.Tensor":
    """Return [h, w, channels] float32 on `device`, in [0, 1] and in the texture's colour space: mip `level`, without rounding to 8
    bits.

    Raises InputError for a texture or a mip that is not there.
    """
    import torch

    from ntc.codec.reference import texel_centres
    from ntc.codec.registry import codec_of

    own = pack.textures[_checked(pack, texture, level)]
    mip = latent_levels(own.width, own.height, pack.config)[level]
    at = torch.from_numpy(texel_centres(mip.texel_width, mip.texel_height)).to(device)
    lod = torch.full((len(at),), float(level), device=device)
    texels: torch.Tensor = codec_of(pack.config).torch_twin(pack, device).texels(texture, at, lod, own.wrap)
    return texels.reshape(mip.texel_height, mip.texel_width, own.channels)


def decode_to_moderngl(
    gl: TextureMaker[Uploaded_co], pack: Pack, texture: int, map_name: MapName = "base"
) -> Uploaded_co:
    """Return a moderngl.Texture made in the context `gl`: one map with all mips of the pack, RGBA of 8 bits a component.

    Colours that are sRGB are read as linear ones by shaders. Greys are repeated in red, green and blue, missing alpha is 255, other
    missing components are 0. Row 0 of the image is row 0 of the texture: v = 0, as in glTF. Raises InputError for a texture or a map
    that is not there.
    """
    own = pack.textures[_checked(pack, texture, 0)]
    if map_name not in own.maps:
        raise InputError(f"{pack.name}: texture {texture} has no map {map_name}; it has {', '.join(own.maps)}")
    is_srgb = map_name == "emissive" or (map_name == "base" and own.color_space == "srgb")
    mips = [_rgba(decode_maps(pack, texture, level)[map_name]) for level in range(mip_count(pack, texture))]
    made = gl.texture((own.width, own.height), 4, mips[0].tobytes(), internal_format=SRGB8_ALPHA8 if is_srgb else RGBA8)
    if len(mips) > 1:
        made.build_mipmaps(0, len(mips) - 1)
    for level, pixels in enumerate(mips[1:], start=1):
        made.write(pixels.tobytes(), level=level)
    return made


def _rgba(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width, channels = pixels.shape
    found = np.zeros((height, width, 4), np.uint8)
    found[..., 3] = 255
    found[..., :channels] = pixels
    if channels == 1:
        found[..., 1:3] = pixels
    return found
