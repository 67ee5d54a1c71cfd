"""What workers do, whichever machine they are on: look at images, and encode groups of them. Messages hold paths, never pixels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import torch

from ntc.codec.config import FeatureName
from ntc.codec.encoding import EncodingOptions
from ntc.codec.maps import MapName
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import raw_features
from ntc.library.joining import SETTINGS
from ntc.library.records import Shard
from ntc.library.writer import shard_of
from ntc.pack.file import pack_bytes
from ntc.training.encode import encode_textures
from viewer.encoding.sources import Reading, TextureRef, read_texture, stamp_of


@dataclass(frozen=True)
class LookJob:
    """Read images, to know what there is."""

    refs: tuple[TextureRef, ...]
    reading: Reading
    features: FeatureName | None = None
    """Also by which the groups will be found."""


@dataclass(frozen=True, slots=True)
class Looked:
    """What a texture is, besides its pixels."""

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
    """Of these textures."""
    config: CodecSettings
    options: EncodingOptions
    settings: str
    """Key of all this (`ntc.library.joining.settings_key`)."""

    @property
    def texels(self) -> int:
        """Of mip 0 of all textures: how much work it is."""
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
    pack = encode_textures(textures, job.grouping, job.config, job.options)
    pack = replace(pack, training={**pack.training, SETTINGS: job.settings})
    data = pack_bytes(pack)
    return Encoded(shard_of(pack, data), data)
