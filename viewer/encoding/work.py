"""Work of encoding jobs, on any machine: reading the facts of images, and encoding groups of them. Messages hold paths, never
pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import UNIVERSAL, FeatureName, GroupingConfig
from ntc.codec.encoding import EncodingOptions
from ntc.codec.maps import MAP_WEIGHTS, MapName, MapWeightsName
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.features import raw_features
from ntc.grouping import make_grouping
from ntc.io import read_file
from ntc.library.index import Stamp
from ntc.library.joining import SETTINGS
from ntc.pack.file import pack_bytes, read_pack
from ntc.training.encode import encode_textures
from viewer.locations import named_scene
from viewer.scene.images import IMAGE_SUFFIXES, folder_images, is_constant, read_image, split_alpha
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, has_source, reduce_texture, source_texture

LIST_SUFFIX = ".txt"
LARGEST_LIST = 1 << 28
"""Most bytes of a list of paths."""


@dataclass(frozen=True, slots=True)
class TextureRef:
    """Reference to a texture: an image file, or a texture of a scene."""

    path: str
    """Path of the image or of the scene."""
    name: str
    category: str | None = None
    index: int | None = None
    """Id of the texture in a scene. None: the file is the image."""


@dataclass(frozen=True)
class ReadOptions:
    """Settings for reading textures."""

    texture_size: int | None = None
    """Most texels a side. None: full size."""
    maps: MapChoice = "base"
    """Maps to read of a scene."""
    map_weights: MapWeightsName = "seen"


def texture_refs(source: Path, maps: MapChoice) -> tuple[TextureRef, ...]:
    """Return the textures of a folder of images, of a text file with one image path per line, or of a scene. Raises InputError."""
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
    # Relative paths start at the folder of the list.
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


def read_texture(ref: TextureRef, reading: ReadOptions) -> SourceTexture | None:
    """Return the texture with its pixels; None where all texels of an image are equal. Raises InputError."""
    if ref.index is not None:
        texture = source_texture(_scene(ref.path), ref.index, reading.texture_size, reading.maps)
        return replace(texture, map_weights=MAP_WEIGHTS[reading.map_weights])
    pixels = read_image(Path(ref.path))
    color, alpha = split_alpha(pixels)
    if alpha is None:
        pixels = color
    if is_constant(pixels):
        return None
    whole = SourceTexture(ref.name, pixels, hash_pixels(pixels), category=ref.category)
    return whole if reading.texture_size is None else reduce_texture(whole, reading.texture_size)


def stamp_of(path: str) -> Stamp | None:
    """Return the size and time of the last change of a file; None where it cannot be read."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def blank(shape: Sequence[int]) -> NDArray[np.uint8]:
    """Return zeros of a shape that take one byte of memory."""
    return np.broadcast_to(np.uint8(0), tuple(shape))


@dataclass(frozen=True)
class InspectJob:
    """Job that reads the facts of images."""

    refs: tuple[TextureRef, ...]
    reading: ReadOptions
    features: FeatureName | None = None
    """Features to compute for the grouping; None for none."""


@dataclass(frozen=True, slots=True)
class ImageInfo:
    """Facts of a texture, without its pixels."""

    ref: TextureRef
    pixel_hash: str
    """Identity of the pixels; "" for a constant image, which is not encoded."""
    width: int = 1
    """Width in texels of the texture to encode."""
    height: int = 1
    channels: int = 1
    maps: tuple[MapName, ...] = ("base",)
    features: tuple[float, ...] = ()
    stamp: Stamp | None = None
    """Size and time of the last change of the image file. None: it changed while it was read."""


@dataclass(frozen=True)
class EncodeJob:
    """Job that encodes textures into a pack."""

    textures: tuple[ImageInfo, ...]
    reading: ReadOptions
    grouping: Grouping
    """Grouping of these textures."""
    config: CodecSettings
    options: EncodingOptions
    settings: str
    """Key of the settings (`ntc.library.joining.settings_key`)."""
    decoders: Path | None = None
    """Pack whose decoders encode the textures. None: new decoders."""


WorkJob = InspectJob | EncodeJob
WorkResult = tuple[ImageInfo, ...] | bytes
"""Facts of images, or the bytes of a pack."""


def work(job: WorkJob) -> WorkResult:
    """Return the result of a job. Raises InputError where it cannot be done; then nothing has been written."""
    if _computes_with_torch(job):
        import torch

        # There is a worker for each core, and sums must not depend on the number of threads.
        torch.set_num_threads(1)
    if isinstance(job, InspectJob):
        return tuple(_inspected(ref, job) for ref in job.refs)
    return _encoded(job)


def _computes_with_torch(job: WorkJob) -> bool:
    return job.features is not None if isinstance(job, InspectJob) else codec_of(job.config).trains


def _read(ref: TextureRef, reading: ReadOptions) -> SourceTexture | None:
    try:
        return read_texture(ref, reading)
    except MemoryError as error:
        raise InputError(
            f"{ref.path}: takes more memory than there is; give it smaller, or set --texture-size"
        ) from error


def _inspected(ref: TextureRef, job: InspectJob) -> ImageInfo:
    stamp = stamp_of(ref.path)
    texture = _read(ref, job.reading)
    if stamp != stamp_of(ref.path):
        # The file changed while it was read. Without a stamp, later runs read it again.
        stamp = None
    if texture is None:
        return ImageInfo(ref, "", stamp=stamp)
    features = tuple(raw_features(job.features, [texture])[0].tolist()) if job.features is not None else ()
    return ImageInfo(ref, texture.pixel_hash, *texture.size, texture.channels, texture.maps, features, stamp)


def _encoded(job: EncodeJob) -> bytes:
    textures = list[SourceTexture]()
    for known in job.textures:
        texture = _read(known.ref, job.reading)
        if texture is None or texture.pixel_hash != known.pixel_hash:
            raise InputError(f"{known.ref.path}: has changed since it was read; run the command again")
        textures.append(texture)
    if job.decoders is not None:
        pack = codec_of(job.config).encode_with_decoders(textures, read_pack(job.decoders), job.options)
    else:
        ships = job.grouping.name == UNIVERSAL
        grouping = make_grouping(GroupingConfig(UNIVERSAL), textures) if ships else job.grouping
        pack = encode_textures(textures, grouping, job.config, job.options)
    return pack_bytes(replace(pack, training={**pack.training, SETTINGS: job.settings}))
