"""Where textures to encode lie: workers are told paths, and read the pixels themselves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MAP_WEIGHTS, MapWeightsName
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.io import read_file
from viewer.locations import named_scene
from viewer.scene.images import IMAGE_SUFFIXES, folder_images, is_constant, read_image, split_alpha
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, has_source, reduce_texture, source_texture

LIST_SUFFIX = ".txt"
LARGEST_LIST = 1 << 28
"""Bytes of a list of paths."""


@dataclass(frozen=True, slots=True)
class TextureRef:
    """One texture, by where it lies."""

    path: str
    """Of the image, or of the scene."""
    name: str
    category: str | None = None
    index: int | None = None
    """In a scene: the texture's id. None: the file is the image."""


@dataclass(frozen=True)
class Reading:
    """How textures are read."""

    texture_size: int | None = None
    """Texels a side at most. None: full size."""
    maps: MapChoice = "base"
    """Of a scene."""
    map_weights: MapWeightsName = "seen"


def texture_refs(source: Path, maps: MapChoice) -> tuple[TextureRef, ...]:
    """The textures of a folder of images, a list of image paths (a text file, a path a line) or a scene. Raises InputError."""
    if source.is_dir():
        return tuple(_image_ref(path, source) for path in folder_images(source))
    if source.suffix.lower() == LIST_SUFFIX:
        return _listed(source)
    path = named_scene(source)
    scene = load_scene(path)
    chosen = [index for index, texture in enumerate(scene.textures) if has_source(texture, maps)]
    return tuple(TextureRef(str(path), scene.textures[i].name, scene.textures[i].category, i) for i in chosen)


def _image_ref(path: Path, folder: Path) -> TextureRef:
    place = path.relative_to(folder)
    return TextureRef(str(path.absolute()), place.with_suffix("").as_posix(), place.parent.name or None)


def _listed(path: Path) -> tuple[TextureRef, ...]:
    try:
        lines = read_file(path, LARGEST_LIST).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is no list of image paths that can be read ({error}); give a path a line") from error
    named = [line.strip() for line in lines]
    # Relative paths begin at the list, as those of a scene do at its file.
    images = [(path.parent / line).absolute() for line in named if line and not line.startswith("#")]
    wrong = [image for image in images if image.suffix.lower() not in IMAGE_SUFFIXES]
    if wrong or not images:
        raise InputError(
            f"{path}: {wrong[0] if wrong else 'names nothing'}: give paths of images (PNG, JPEG ...), one a line"
        )
    unique = dict.fromkeys(images)
    return tuple(
        TextureRef(str(image), image.with_suffix("").as_posix().lstrip("/"), image.parent.name) for image in unique
    )


@lru_cache(maxsize=1)
def _scene(path: str) -> Scene:
    return load_scene(Path(path))


def read_texture(ref: TextureRef, reading: Reading) -> SourceTexture | None:
    """The texture with its pixels; None where all texels of an image are equal. Raises InputError."""
    if ref.index is not None:
        found = source_texture(_scene(ref.path), ref.index, reading.texture_size, reading.maps)
        return replace(found, map_weights=MAP_WEIGHTS[reading.map_weights])
    pixels = read_image(Path(ref.path))
    color, alpha = split_alpha(pixels)
    if alpha is None:
        pixels = color
    if is_constant(pixels):
        return None
    whole = SourceTexture(ref.name, pixels, hash_pixels(pixels), category=ref.category)
    return whole if reading.texture_size is None else reduce_texture(whole, reading.texture_size)


def stamp_of(path: str) -> tuple[int, int] | None:
    """(bytes, time of change in ns) of a file; None where there is none."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def blank(shape: Sequence[int]) -> NDArray[np.uint8]:
    """[shape] zeros that share one byte."""
    return np.broadcast_to(np.uint8(0), tuple(shape))
