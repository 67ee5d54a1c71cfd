"""Encoding arrays of pixels."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace, GroupingConfig, WrapMode
from ntc.codec.encoding import CancelQuestion, EncodingChoices, Target, texture_set
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.maps import MAPS, MapName, joint_maps
from ntc.codec.model import Grouping, Pack
from ntc.codec.registry import CodecName, codec_named
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.grouping import GroupingInputs, make_grouping


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
) -> SourceTexture:
    """Return the maps of a material as one texture to encode, each [H, W, C] uint8 of the same size.

    `base` and `emissive` are sRGB, [H, W, 3] (`base` up to 4, coverage last); `normal` is x and y as (n + 1) / 2, [H, W, 2]; all
    others are linear, [H, W, 1]. Raises InputError for maps that do not fit.
    """
    unknown = [own for own in maps if own not in MAPS]
    sizes = {own: pixels.shape[:2] for own, pixels in maps.items()}
    if not maps or unknown or len(set(sizes.values())) > 1:
        raise InputError(f"{name}: give maps of one size among {', '.join(MAPS)}, not {sizes}")
    ordered = tuple(own for own in MAPS if own in maps)
    try:
        joint_maps([((own,), maps[own].shape[2]) for own in ordered])
    except (ValueError, IndexError) as error:
        raise InputError(f"{name}: {error}") from error
    pixels = np.concatenate([maps[own] for own in ordered], axis=2)
    if pixels.dtype != np.uint8:
        raise InputError(f"{name}: is {pixels.dtype}; give uint8")
    return SourceTexture(name, pixels, hash_pixels(pixels), "srgb", wrap, category, ordered)


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
