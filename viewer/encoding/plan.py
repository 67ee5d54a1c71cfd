"""The jobs that encode a set of textures. What they are depends on the textures and on what is asked for, never on how many workers
there are or on what has been encoded before."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ntc.codec.config import DEFAULT_CLUSTERS, UNIVERSAL, GroupingConfig
from ntc.codec.encoding import EncodingChoices, EncodingOptions, TextureSet, common_channels
from ntc.codec.maps import MapName, joint_maps
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.registry import codec_named, codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.grouping.category import read_labels
from ntc.library.joining import settings_key
from viewer.encoding.sources import Reading, blank
from viewer.encoding.work import EncodeJob, Looked

JOB_TEXELS = 1 << 24
"""Texels of mip 0 of a job, about: tens of seconds of one core in codec `block`."""
LARGEST_JOB = 2 * JOB_TEXELS
"""A group of more is cut into several, each with a decoder of its own."""
MOST_TEXTURES = 64
"""Of a job, where groups leave the choice."""
LIBRARY_TEXTURE = (1024, 1024)
"""Settings of a library are chosen as for textures of this size: they must not change with what is added later."""
LIBRARY_GROUP = 8
"""And as for groups of so many."""
GROUPINGS_OF_JOBS = ("clustered", "random", "category", "baseline", "single", UNIVERSAL)


@dataclass(frozen=True)
class Asked:
    """What is to be encoded how."""

    reading: Reading
    grouping: GroupingConfig
    codec: str
    """Its name."""
    choices: EncodingChoices
    labels: Path | None = None
    one_pack: bool = False
    """Whether all is to become one pack, whose textures share the settings of one codec."""


@dataclass(frozen=True, order=True)
class _Kind:
    """Textures that one codec's settings serve."""

    maps: tuple[MapName, ...]
    channels: int


def needs_features(asked: Asked) -> bool:
    """Whether the groups are found by features."""
    return asked.grouping.name in ("clustered", "random")


def stand_in(texture: Looked) -> SourceTexture:
    """A texture whose pixels take no memory, for whoever needs the other fields alone."""
    pixels = blank((texture.height, texture.width, texture.channels))
    return SourceTexture(texture.ref.name, pixels, texture.pixel_hash, category=texture.ref.category, maps=texture.maps)


def _grouping(asked: Asked, textures: Sequence[Looked]) -> Grouping:
    config = asked.grouping
    stand_ins = [stand_in(texture) for texture in textures]
    if needs_features(asked) and config.clusters is None:
        texels = sum(each.width * each.height for each in textures)
        most = min(max(DEFAULT_CLUSTERS, math.ceil(texels / JOB_TEXELS)), len(textures))
        config = replace(config, clusters=most)
    known = {each.pixel_hash: np.array(each.features) for each in textures} if needs_features(asked) else {}
    labels = read_labels(asked.labels, stand_ins) if asked.labels is not None else {}
    return make_grouping(config, stand_ins, GroupingInputs(labels=labels, features=FeatureOptions(known=known)))


def _codec(asked: Asked, kind: _Kind, sizes: Sequence[tuple[int, int]], groups: int) -> CodecSettings:
    known = TextureSet(sizes, groups, kind.channels, asked.choices.levels, kind.maps)
    return codec_named(asked.codec).settings_for(known, asked.choices)


def _library_codec(asked: Asked, kind: _Kind) -> CodecSettings:
    alone = {UNIVERSAL: 0, "baseline": LIBRARY_GROUP}
    return _codec(asked, kind, [LIBRARY_TEXTURE] * LIBRARY_GROUP, alone.get(asked.grouping.name, 1))


def _options(asked: Asked) -> EncodingOptions:
    return codec_named(asked.codec).job_options_for(asked.choices)


def _settings(asked: Asked, config: CodecSettings) -> str:
    """Key of everything that decides about a texture's numbers besides its pixels and those of its group."""
    grouping = replace(asked.grouping, clusters=None)
    training = codec_of(config).recorded_options(_options(asked))
    wanted = {"reading": asdict(asked.reading), "grouping": asdict(grouping), "training": training}
    return settings_key(config, asked.grouping.name, wanted)


def encode_jobs(asked: Asked, textures: Sequence[Looked]) -> list[EncodeJob]:
    """The jobs that encode `textures` (no two with one pixel hash, none constant), all of them.

    Raises InputError for settings that cannot be, and a grouping that needs pictures of the scene.
    """
    if asked.grouping.name not in GROUPINGS_OF_JOBS:
        raise InputError(
            f"--grouping {asked.grouping.name}: is not encoded by jobs; leave --workers out, or choose another grouping"
        )
    if not textures:
        return []
    grouping = _grouping(asked, textures)
    parts = [
        (kind, part)
        for kind, members in _by_kind(asked, textures).items()
        for part in _parts(grouping, members, textures)
    ]
    sizes = [(each.width, each.height) for each in textures]
    decoders = 0 if grouping.name == UNIVERSAL else sum(len({group for _, group in part}) for _, part in parts)
    configs: dict[_Kind, CodecSettings] = {}
    for kind, _ in parts:
        if kind not in configs:
            configs[kind] = _codec(asked, kind, sizes, decoders) if asked.one_pack else _library_codec(asked, kind)
    keys = {kind: _settings(asked, config) for kind, config in configs.items()}
    jobs = list[EncodeJob]()
    for kind, part in parts:
        own = Grouping.of_labels(grouping.name, [group for _, group in part], grouping.parameters)
        chosen = tuple(textures[index] for index, _ in part)
        jobs.append(EncodeJob(chosen, asked.reading, own, configs[kind], _options(asked), keys[kind]))
    return jobs


def _by_kind(asked: Asked, textures: Sequence[Looked]) -> Mapping[_Kind, list[int]]:
    if asked.one_pack:
        return {_Kind(*joint_maps((each.maps, each.channels) for each in textures)): list(range(len(textures)))}
    found: dict[_Kind, list[int]] = {}
    for index, each in enumerate(textures):
        base_alone = each.maps == ("base",)
        channels = common_channels(each.channels) if base_alone else each.channels
        found.setdefault(_Kind(each.maps, channels), []).append(index)
    return found


def _parts(grouping: Grouping, members: Sequence[int], textures: Sequence[Looked]) -> Iterator[list[tuple[int, int]]]:
    """`members` in jobs: (texture, group) of each. Groups stay whole up to LARGEST_JOB; textures that share nothing, or the decoder
    that ships with the program, come in chunks."""
    if grouping.name in ("baseline", UNIVERSAL):
        yield from _chunks([(index, grouping.groups[index]) for index in members], textures, JOB_TEXELS, MOST_TEXTURES)
        return
    groups: dict[int, list[tuple[int, int]]] = {}
    for index in members:
        groups.setdefault(grouping.groups[index], []).append((index, grouping.groups[index]))
    for group in groups.values():
        yield from _chunks(group, textures, LARGEST_JOB, len(group))


def _chunks(
    members: Sequence[tuple[int, int]], textures: Sequence[Looked], most_texels: int, most: int
) -> Iterator[list[tuple[int, int]]]:
    chunk: list[tuple[int, int]] = []
    texels = 0
    for index, group in members:
        own = textures[index].width * textures[index].height
        if chunk and (texels + own > most_texels or len(chunk) >= most):
            yield chunk
            chunk, texels = [], 0
        chunk.append((index, group))
        texels += own
    yield chunk


def without(job: EncodeJob, held: frozenset[str]) -> EncodeJob | None:
    """The job without textures whose pixel hash is `held`; None where nothing is left."""
    kept = [number for number, each in enumerate(job.textures) if each.pixel_hash not in held]
    if len(kept) == len(job.textures):
        return job
    if not kept:
        return None
    groups = [job.grouping.groups[number] for number in kept]
    grouping = Grouping.of_labels(job.grouping.name, groups, job.grouping.parameters)
    return replace(job, textures=tuple(job.textures[number] for number in kept), grouping=grouping)
