"""The work of encoding jobs, on any machine: look at images, and encode groups of them. Messages hold paths, never pixels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.config import UNIVERSAL, FeatureName, GroupingConfig
from ntc.codec.encoding import EncodingOptions
from ntc.codec.maps import MAP_WEIGHTS, MapName, MapWeightsName
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.features import raw_features
from ntc.grouping import make_grouping
from ntc.io import read_file
from ntc.library.index import Shard
from ntc.library.reading import SETTINGS
from ntc.library.writer import shard_of
from ntc.pack.file import pack_bytes
from ntc.training.encode import encode_textures
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
    """Path of the image or of the scene."""
    name: str
    category: str | None = None
    index: int | None = None
    """Id of the texture in a scene. None: the file is the image."""


@dataclass(frozen=True)
class Reading:
    """Settings for reading textures."""

    texture_size: int | None = None
    """Texels a side at most. None: full size."""
    maps: MapChoice = "base"
    """Maps to read of a scene."""
    map_weights: MapWeightsName = "seen"


def texture_refs(source: Path, maps: MapChoice) -> tuple[TextureRef, ...]:
    """Return the textures of a folder of images, a list of image paths (a text file, a path a line) or a scene. Raises InputError."""
    if source.is_dir():
        places = [(path, path.relative_to(source)) for path in folder_images(source)]
        return tuple(
            TextureRef(str(path.absolute()), place.with_suffix("").as_posix(), place.parent.name or None)
            for path, place in places
        )
    if source.suffix.lower() == LIST_SUFFIX:
        return _listed(source)
    path = named_scene(source)
    scene = load_scene(path)
    chosen = [index for index, texture in enumerate(scene.textures) if has_source(texture, maps)]
    return tuple(TextureRef(str(path), scene.textures[i].name, scene.textures[i].category, i) for i in chosen)


def _listed(path: Path) -> tuple[TextureRef, ...]:
    try:
        lines = read_file(path, LARGEST_LIST).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: cannot be read as a list of image paths ({error}); write one path per line"
        ) from error
    named = [line.strip() for line in lines]
    # Relative paths begin at the list, as those of a scene do at its file.
    images = [(path.parent / line).absolute() for line in named if line and not line.startswith("#")]
    wrong = [image for image in images if image.suffix.lower() not in IMAGE_SUFFIXES]
    if wrong or not images:
        raise InputError(
            f"{path}: {wrong[0] if wrong else 'names nothing'}: write paths of images (PNG, JPEG ...), one per line"
        )
    unique = dict.fromkeys(images)
    return tuple(
        TextureRef(str(image), image.with_suffix("").as_posix().lstrip("/"), image.parent.name) for image in unique
    )


@lru_cache(maxsize=1)
def _scene(path: str) -> Scene:
    return load_scene(Path(path))


def read_texture(ref: TextureRef, reading: Reading) -> SourceTexture | None:
    """Return the texture with its pixels; None where all texels of an image are equal. Raises InputError."""
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
    """Return (bytes, time of change in ns) of a file; None where there is none."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def blank(shape: Sequence[int]) -> NDArray[np.uint8]:
    """Return [shape] zeros that share one byte."""
    return np.broadcast_to(np.uint8(0), tuple(shape))


@dataclass(frozen=True)
class LookJob:
    """Read images, to know what there is."""

    refs: tuple[TextureRef, ...]
    reading: Reading
    features: FeatureName | None = None
    """Also by which the groups will be found."""


@dataclass(frozen=True, slots=True)
class Looked:
    """The facts about a texture, besides its pixels."""

    ref: TextureRef
    pixel_hash: str
    """Empty: the image is constant, there is nothing to encode."""
    width: int = 1
    """Texels, as it is to be encoded."""
    height: int = 1
    channels: int = 1
    maps: tuple[MapName, ...] = ("base",)
    features: tuple[float, ...] = ()
    stamp: tuple[int, int] | None = None
    """(bytes, time of change in ns) of an image file, from before it was read. None: it changed meanwhile."""


@dataclass(frozen=True)
class EncodeJob:
    """Encode textures into a pack of its own."""

    textures: tuple[Looked, ...]
    reading: Reading
    grouping: Grouping
    """Grouping of these textures."""
    config: CodecSettings
    options: EncodingOptions
    settings: str
    """Key of all this (`ntc.library.reading.settings_key`)."""

    @property
    def texels(self) -> int:
        """Number of texels of mip 0 of all textures, a measure of the work."""
        return sum(each.width * each.height for each in self.textures)


@dataclass(frozen=True)
class Unread:
    """Images that could not be read: paths, and why. Nothing has been done then."""

    problems: Mapping[TextureRef, str]


@dataclass(frozen=True)
class Encoded:
    """A pack, as a library keeps it."""

    shard: Shard
    data: bytes


WorkJob = LookJob | EncodeJob
WorkResult = tuple[Looked, ...] | Encoded | Unread


def work(job: WorkJob) -> WorkResult:
    """Do a job. Raises InputError where it cannot be done for another reason than images."""
    # One worker for each core; and numbers must not depend on how many threads add them up.
    torch.set_num_threads(1)
    return _looked(job) if isinstance(job, LookJob) else _encoded(job)


def _read_all(refs: Sequence[TextureRef], reading: Reading) -> tuple[list[SourceTexture | None], dict[TextureRef, str]]:
    found, problems = list[SourceTexture | None](), dict[TextureRef, str]()
    for ref in refs:
        try:
            found.append(read_texture(ref, reading))
        except InputError as error:
            problems[ref] = str(error)
        except MemoryError:
            problems[ref] = f"{ref.path}: takes more memory than there is; give it smaller, or set --texture-size"
    return found, problems


def _looked(job: LookJob) -> tuple[Looked, ...] | Unread:
    found = list[Looked]()
    problems = dict[TextureRef, str]()
    for ref in job.refs:
        # One by one: only one image's pixels are held.
        before = stamp_of(ref.path)
        ((*textures,), own) = _read_all([ref], job.reading)
        problems |= own
        # A file that is being written has another hash a moment later.
        stamp = before if before == stamp_of(ref.path) else None
        found += [replace(_look(ref, texture, job.features), stamp=stamp) for texture in textures]
    return Unread(problems) if problems else tuple(found)


def _look(ref: TextureRef, texture: SourceTexture | None, features: FeatureName | None) -> Looked:
    if texture is None:
        return Looked(ref, "")
    numbers = tuple(raw_features(features, [texture])[0].tolist()) if features is not None else ()
    return Looked(ref, texture.pixel_hash, *texture.size, texture.channels, texture.maps, numbers)


def _encoded(job: EncodeJob) -> Encoded | Unread:
    read, problems = _read_all([each.ref for each in job.textures], job.reading)
    if problems:
        return Unread(problems)
    textures = list[SourceTexture]()
    for known, texture in zip(job.textures, read, strict=True):
        if texture is None or texture.pixel_hash != known.pixel_hash:
            problems[known.ref] = f"{known.ref.path}: has changed since it was looked at; run the command again"
        else:
            textures.append(texture)
    if problems:
        return Unread(problems)
    ships = job.grouping.name == UNIVERSAL
    grouping = make_grouping(GroupingConfig(UNIVERSAL), textures) if ships else job.grouping
    pack = encode_textures(textures, grouping, job.config, job.options)
    pack = replace(pack, training={**pack.training, SETTINGS: job.settings})
    data = pack_bytes(pack)
    return Encoded(shard_of(pack, data), data)
