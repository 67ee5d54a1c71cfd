"""The functions of the library that nothing else in the package holds: arrays in, packs out, and back (docs/reference/api.md)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace, GroupingConfig, WrapMode
from ntc.codec.encoding import CancelQuestion, EncodingChoices, Target, texture_set
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.latents import texture_levels
from ntc.codec.maps import CODED_MAPS, SRGB_MAPS, MapName, joint_maps, map_slices
from ntc.codec.model import Grouping, Pack
from ntc.codec.reference import decode_image
from ntc.codec.registry import CodecName, codec_named, codec_of
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.grouping import GroupingInputs, make_grouping
from ntc.pack.native import native_image

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
    return len(texture_levels(own, pack.config))


def _checked(pack: Pack, texture: int, level: int) -> int:
    """Return the index `texture`, checked: the pack has it with a mip `level`. Raises InputError."""
    if not 0 <= texture < len(pack.textures):
        raise InputError(f"{pack.name}: has no texture {texture}; it has 0 to {len(pack.textures) - 1}")
    own = pack.textures[texture]
    levels = len(texture_levels(own, pack.config))
    if not 0 <= level < levels:
        raise InputError(f"{pack.name}: texture {texture} has no mip {level}; it has 0 to {levels - 1}")
    return texture


def decode(
    pack: Pack, texture: int, level: int = 0, backend: Literal["auto", "libntc", "numpy", "torch"] = "auto"
) -> NDArray[np.uint8]:
    """Return [h, w, channels] uint8: mip `level` of a texture, in its colour space, the channels of its maps side by side.

    `libntc` is the library in C, which is the fastest and within one 8-bit step of `numpy`, the float64 reference. `auto` takes
    libntc where it was built and decodes the pack, else numpy. `torch` decodes codec `grid` in float32, faster than numpy; for codec
    `block` it is numpy. Raises InputError for a texture or a mip that is not there, and for a missing `libntc`.
    """
    _checked(pack, texture, level)
    if backend in ("auto", "libntc"):
        image = native_image(pack, texture, level)
        if image is None and backend == "libntc":
            raise InputError(
                f"{pack.name}: libntc was not built with this package, or does not decode the pack; use numpy"
            )
        return image if image is not None else decode_image(pack, texture, level)
    if backend == "numpy":
        return decode_image(pack, texture, level)
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
    _checked(pack, texture, level)
    mip: torch.Tensor = codec_of(pack.config).torch_twin(pack, device).mip(texture, level)
    return mip


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
    is_srgb = own.color_space == "srgb" if map_name == "base" else map_name in SRGB_MAPS
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


def texture(
    pixels: NDArray[np.uint8],
    name: str = "texture",
    color_space: ColorSpace = "srgb",
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat"),
    category: str | None = None,
) -> SourceTexture:
    """Return a texture to encode, of `pixels` [H, W, C] uint8, 0 to 255, C from 1 to 4; row 0 is at v = 0, as in glTF.

    `color_space` says what the numbers are; PSNR is over them as they are. `category` is what the grouping `category` goes by. Raises
    InputError for another type or shape.
    """
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or not 1 <= pixels.shape[-1] <= 4 or pixels.size == 0:
        raise InputError(f"{name}: is {pixels.dtype} {list(pixels.shape)}; give uint8 [height, width, 1 to 4 channels]")
    return SourceTexture(name, pixels, hash_pixels(pixels), color_space, wrap, category)


def material(
    maps: Mapping[MapName, NDArray[np.uint8]],
    name: str = "material",
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat"),
    category: str | None = None,
    cutoff: float | None = None,
) -> SourceTexture:
    """Return the maps of a material as one texture to encode, each [H, W, C] uint8 of the same size.

    `base` and `emissive` are sRGB, [H, W, 3] (`base` up to 4, coverage last); `normal` is x and y as (n + 1) / 2, [H, W, 2]; all
    others are linear, [H, W, 1]. `cutoff`, above 0 and up to 1, is what `alpha` is tested against (None: it is blended): the encoder
    keeps each texel on its side, and as many above it in coarse mips. Raises InputError for maps that do not fit.
    """
    if cutoff is not None and not ("alpha" in maps and 0.0 < cutoff <= 1.0):
        raise InputError(f"{name}: a cutoff of {cutoff:g} needs the map alpha, and lies above 0 and up to 1")
    unknown = [own for own in maps if own not in CODED_MAPS]
    sizes = {own: pixels.shape[:2] for own, pixels in maps.items()}
    if not maps or unknown or len(set(sizes.values())) > 1:
        raise InputError(f"{name}: give maps of one size among {', '.join(CODED_MAPS)}, not {sizes}")
    ordered = tuple(own for own in CODED_MAPS if own in maps)
    try:
        joint_maps([((own,), maps[own].shape[2]) for own in ordered])
    except (ValueError, IndexError) as error:
        raise InputError(f"{name}: {error}") from error
    pixels = np.concatenate([maps[own] for own in ordered], axis=2)
    if pixels.dtype != np.uint8:
        raise InputError(f"{name}: is {pixels.dtype}; give uint8")
    return SourceTexture(name, pixels, hash_pixels(pixels), "srgb", wrap, category, ordered, cutoff)


def encode(
    textures: Sequence[SourceTexture],
    *,
    codec: CodecName = "block",
    grouping: GroupingConfig | Grouping | None = None,
    inputs: GroupingInputs | None = None,
    target: Target | None = None,
    training: TrainingConfig | None = None,
    seed: int = 0,
    cancelled: CancelQuestion | None = None,
) -> Pack:
    """Encode `textures` into a pack. The same arguments give the same pack on one machine.

    `grouping` says which textures share a decoder (None: each has its own); `inputs` are views and labels that some groupings go
    by. Codec `block` is encoded in closed form, to `target`: bits a texel, megabytes, or PSNR in dB of every texture (None: 2 bits).
    Codec `grid` is trained by torch as `training` says (None: the recipe `best` with `seed`), and takes no target. `cancelled` is
    asked now and then.

    Raises InputError for what cannot be encoded, TrainingCancelledError when `cancelled` says so, and TrainingFailedError where
    numbers overflow again and again.
    """
    if not textures:
        raise InputError("there is no texture to encode")
    chosen = codec_named(codec)
    choices = EncodingChoices(target=target, seed=seed)
    if training is not None and not chosen.trains:
        raise InputError(f"codec {codec}: takes no training; leave it out")
    if target is not None and chosen.refusals(choices):
        raise InputError(f"codec {codec}: takes no target; leave it out")
    found = grouping
    if not isinstance(found, Grouping):
        found = make_grouping(found or GroupingConfig("baseline"), textures, inputs or GroupingInputs())
    # It takes torch, which takes seconds to import.
    from ntc.training.encode import encode_chosen, encode_textures

    if training is None:
        return encode_chosen(textures, found, chosen, choices, cancelled=cancelled)
    settings = chosen.settings_for(texture_set(textures, 0), EncodingChoices(training.recipe))
    return encode_textures(textures, found, settings, training, cancelled=cancelled)
