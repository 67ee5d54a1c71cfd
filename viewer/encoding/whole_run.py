"""Encoding a set of textures into a library: look at them, plan jobs, encode, keep what comes. A second run does what is left.

The jobs depend on the textures and on what is asked for, never on how many workers there are or on what has been encoded before.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ntc.codec.config import DEFAULT_CLUSTERS, UNIVERSAL, GroupingConfig
from ntc.codec.encoding import EncodingChoices, EncodingOptions, TextureSet, common_channels
from ntc.codec.maps import BASE_ALONE, MapName, joint_maps
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.registry import codec_named, codec_of, shipping_codec
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.grouping.category import read_labels
from ntc.library.index import ImageFile, Library, StoredTexture
from ntc.library.joining import settings_key, settings_of
from ntc.pack.file import read_pack
from viewer.encoding.work import (
    EncodeJob,
    ImageInfo,
    LookJob,
    ReadOptions,
    TextureRef,
    WorkJob,
    WorkResult,
    blank,
    stamp_of,
)
from viewer.jobs.executor import Workers, run_jobs

JOB_TEXELS = 1 << 24
"""Texels of mip 0 of a job, about: tens of seconds of one core in codec `block`."""
LARGEST_JOB = 2 * JOB_TEXELS
"""A group of more is cut into several, each with a decoder of its own."""
MOST_TEXTURES = 64
"""Largest number of textures of a job, where groups leave the choice."""
LIBRARY_TEXTURE = (1024, 1024)
"""Settings of a library are chosen as for textures of this size: they must not change with what is added later."""
LIBRARY_GROUP = 8
"""And as for groups of so many."""
GROUPINGS_OF_JOBS = ("clustered", "random", "category", "baseline", "single", UNIVERSAL)


@dataclass(frozen=True)
class EncodeRequest:
    """A request to encode textures: how they are read, grouped and encoded."""

    reading: ReadOptions
    grouping: GroupingConfig
    codec: str
    """Name of the codec."""
    choices: EncodingChoices
    labels: Path | None = None
    one_pack: bool = False
    """True if all textures become one pack and share the settings of one codec."""
    decoders: Path | None = None
    """Pack that gives decoders, codec and grouping. None: textures get decoders of their own."""


@dataclass(frozen=True, order=True)
class _Kind:
    """Textures that one codec's settings serve."""

    maps: tuple[MapName, ...]
    channels: int


def needs_features(request: EncodeRequest) -> bool:
    """Return whether the groups are found by features."""
    return request.grouping.name in ("clustered", "random")


def stand_in(texture: ImageInfo) -> SourceTexture:
    """Return a texture whose pixels take no memory, for whoever needs the other fields alone."""
    pixels = blank((texture.height, texture.width, texture.channels))
    return SourceTexture(texture.ref.name, pixels, texture.pixel_hash, category=texture.ref.category, maps=texture.maps)


def _grouping(request: EncodeRequest, textures: Sequence[ImageInfo]) -> Grouping:
    config = request.grouping
    if config.name == UNIVERSAL:
        # Whoever encodes them has the pixels by which whole materials are grouped.
        return Grouping(UNIVERSAL, (0,) * len(textures), dict(codec_named(shipping_codec()).shipped))
    stand_ins = [stand_in(texture) for texture in textures]
    if needs_features(request) and config.clusters is None:
        texels = sum(each.width * each.height for each in textures)
        most = min(max(DEFAULT_CLUSTERS, math.ceil(texels / JOB_TEXELS)), len(textures))
        config = replace(config, clusters=most)
    known = {each.pixel_hash: np.array(each.features) for each in textures} if needs_features(request) else {}
    labels = read_labels(request.labels, stand_ins) if request.labels is not None else {}
    return make_grouping(config, stand_ins, GroupingInputs(labels=labels, features=FeatureOptions(known=known)))


def _codec(request: EncodeRequest, kind: _Kind, sizes: Sequence[tuple[int, int]], groups: int) -> CodecSettings:
    known = TextureSet(sizes, groups, kind.channels, request.choices.levels, kind.maps)
    return codec_named(request.codec).settings_for(known, request.choices)


def _library_codec(request: EncodeRequest, kind: _Kind) -> CodecSettings:
    alone = {UNIVERSAL: 0, "baseline": LIBRARY_GROUP}
    return _codec(request, kind, [LIBRARY_TEXTURE] * LIBRARY_GROUP, alone.get(request.grouping.name, 1))


def _options(request: EncodeRequest) -> EncodingOptions:
    return codec_named(request.codec).job_options_for(request.choices)


def _settings(request: EncodeRequest, config: CodecSettings) -> str:
    """Return the key of everything that decides about a texture's numbers besides its pixels and those of its group."""
    grouping = replace(request.grouping, clusters=None)
    training = codec_of(config).recorded_options(_options(request))
    wanted = {"reading": asdict(request.reading), "grouping": asdict(grouping), "training": training}
    return settings_key(config, request.grouping.name, wanted)


def encode_jobs(request: EncodeRequest, textures: Sequence[ImageInfo]) -> list[EncodeJob]:
    """Return the jobs that encode `textures` (no two with one pixel hash, none constant), all of them.

    Raises InputError for settings that cannot be, a grouping that needs pictures of the scene, and decoders that cannot be read.
    """
    if request.decoders is not None:
        return _jobs_with_decoders(request, request.decoders, textures)
    if request.grouping.name not in GROUPINGS_OF_JOBS:
        raise InputError(
            f"--grouping {request.grouping.name}: cannot be encoded by jobs; leave --workers out, or choose another grouping"
        )
    if not textures:
        return []
    grouping = _grouping(request, textures)
    parts = [
        (kind, part)
        for kind, members in _by_kind(request, textures).items()
        for part in _parts(grouping, members, textures)
    ]
    sizes = [(each.width, each.height) for each in textures]
    decoders = 0 if grouping.name == UNIVERSAL else sum(len({group for _, group in part}) for _, part in parts)
    configs: dict[_Kind, CodecSettings] = {}
    for kind, _ in parts:
        if kind not in configs:
            configs[kind] = (
                _codec(request, kind, sizes, decoders) if request.one_pack else _library_codec(request, kind)
            )
    keys = {kind: _settings(request, config) for kind, config in configs.items()}
    jobs = list[EncodeJob]()
    for kind, part in parts:
        own = Grouping.of_labels(grouping.name, [group for _, group in part], grouping.parameters)
        chosen = tuple(textures[index] for index, _ in part)
        jobs.append(EncodeJob(chosen, request.reading, own, configs[kind], _options(request), keys[kind]))
    return jobs


def _jobs_with_decoders(request: EncodeRequest, decoders: Path, textures: Sequence[ImageInfo]) -> list[EncodeJob]:
    pack = read_pack(decoders)
    config, name = pack.config, pack.grouping.name
    key = settings_of(config, name, pack.grouping.parameters, pack.training)
    options = codec_of(config).job_options_for(request.choices)
    return [
        EncodeJob(chosen, request.reading, Grouping(name, (0,) * len(chosen)), config, options, key, decoders)
        for part in _chunks([(index, 0) for index in range(len(textures))], textures, JOB_TEXELS, MOST_TEXTURES)
        if (chosen := tuple(textures[index] for index, _ in part))
    ]


def _by_kind(request: EncodeRequest, textures: Sequence[ImageInfo]) -> Mapping[_Kind, list[int]]:
    if request.one_pack:
        return {_Kind(*joint_maps((each.maps, each.channels) for each in textures)): list(range(len(textures)))}
    found: dict[_Kind, list[int]] = {}
    for index, each in enumerate(textures):
        base_alone = each.maps == ("base",)
        channels = common_channels(each.channels) if base_alone else each.channels
        found.setdefault(_Kind(each.maps, channels), []).append(index)
    return found


def _parts(
    grouping: Grouping, members: Sequence[int], textures: Sequence[ImageInfo]
) -> Iterator[list[tuple[int, int]]]:
    """Yield `members` in jobs: (texture, group) of each. Groups stay whole up to LARGEST_JOB; textures that share nothing, or the
    decoder that ships with the program, come in chunks."""
    if grouping.name in ("baseline", UNIVERSAL):
        yield from _chunks([(index, grouping.groups[index]) for index in members], textures, JOB_TEXELS, MOST_TEXTURES)
        return
    groups: dict[int, list[tuple[int, int]]] = {}
    for index in members:
        groups.setdefault(grouping.groups[index], []).append((index, grouping.groups[index]))
    for group in groups.values():
        yield from _chunks(group, textures, LARGEST_JOB, len(group))


def _chunks(
    members: Sequence[tuple[int, int]], textures: Sequence[ImageInfo], most_texels: int, most: int
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
    """Return the job without textures whose pixel hash is `held`; None where nothing is left."""
    kept = [number for number, each in enumerate(job.textures) if each.pixel_hash not in held]
    if len(kept) == len(job.textures):
        return job
    if not kept:
        return None
    groups = [job.grouping.groups[number] for number in kept]
    grouping = Grouping.of_labels(job.grouping.name, groups, job.grouping.parameters)
    return replace(job, textures=tuple(job.textures[number] for number in kept), grouping=grouping)


LOOKED_TOGETHER = 32
"""Images of one job that looks at them."""
Phase = Literal["looking at", "encoding"]


@dataclass(frozen=True)
class RunProgress:
    """Progress of a run."""

    phase: Phase
    done: int
    """Textures."""
    of: int
    share: float
    """Progress of the work, 0 to 1: by texels where they are known."""
    texels_per_second: float
    failures: int
    note: str = ""
    """A job that was begun once more, and why."""


@dataclass(frozen=True, slots=True)
class Stored:
    """A texture that the library holds."""

    ref: TextureRef
    texture: StoredTexture


@dataclass
class RunResult:
    """The result of a run."""

    asked: int
    """Textures that were named."""
    constant: int = 0
    """Images of one colour, which need no encoding."""
    stored: list[Stored] = field(default_factory=list)
    """Textures that the library holds, in order; those with equal pixels once."""
    repeated: int = 0
    """Textures with the pixels of another one."""
    encoded: int = 0
    """Number of stored textures that were encoded in this run."""
    failed: dict[str, str] = field(default_factory=dict)
    """Reason why a texture is missing, by path, and in a scene by name too."""
    tried_again: int = 0
    """Jobs that were begun once more."""
    stopped: bool = False
    """True if Ctrl-C stopped the run."""
    seconds: float = 0.0
    texels: int = 0
    """Number of texels that were encoded in this run."""
    settings: tuple[str, ...] = ()
    """Keys by which the library holds the textures."""


class _Run:
    """One run, while it goes on."""

    def __init__(
        self,
        request: EncodeRequest,
        workers: Workers[WorkJob, WorkResult],
        library: Library,
        listen: Callable[[RunProgress], None],
        stopped: Callable[[], bool],
        result: RunResult,
    ) -> None:
        self.request, self.workers, self.library, self.result = request, workers, library, result
        self._listen, self.stopped = listen, stopped
        self._began = time.monotonic()
        self._phase: Phase = "looking at"
        self._done = self._of = self._weight_done = self._weight = 0

    def begin(self, phase: Phase, textures: int, weight: int) -> None:
        """Begin a phase of so many textures, and so much work."""
        self._phase, self._began = phase, time.monotonic()
        self._done, self._of, self._weight_done, self._weight = 0, textures, 0, weight

    def advance(self, textures: int, weight: int, note: str = "") -> None:
        """Report that so much more is done."""
        self._done += textures
        self._weight_done += weight
        now = time.monotonic()
        seconds = max(now - self._began, 1e-6)
        share = self._weight_done / max(self._weight, 1)
        failures = len(self.result.failed)
        self._listen(RunProgress(self._phase, self._done, self._of, share, self._weight_done / seconds, failures, note))

    def tried_again(self, problem: str) -> None:
        """Report that a job is begun once more."""
        self.result.tried_again += 1
        self.advance(0, 0, problem)

    def fail(self, refs: Sequence[TextureRef], problem: str) -> None:
        """Note that these textures will be missing."""
        for ref in refs:
            self.result.failed[ref.path if ref.index is None else f"{ref.path}: {ref.name}"] = problem


def _look_at_all(run: _Run, refs: Sequence[TextureRef]) -> list[ImageInfo]:
    """Look at each of `refs`; those that fail are left out and named."""
    reading, found = run.request.reading, dict[TextureRef, ImageInfo]()
    features = run.request.grouping.features if needs_features(run.request) else None
    plain = features is None and reading.texture_size is None
    for ref in refs:
        known = run.library.images.get(ref.path) if plain and ref.index is None else None
        if known is not None and known.stamp == stamp_of(ref.path):
            found[ref] = ImageInfo(ref, known.pixel_hash, known.width, known.height, known.channels)
    due = [ref for ref in refs if ref not in found]
    run.begin("looking at", len(due), len(due))

    def take(job: WorkJob, result: WorkResult) -> None:
        assert isinstance(result, tuple)
        # Texts that came with a message would be held a second time.
        looked = [replace(each, ref=ref) for each, ref in zip(result, _refs(job), strict=True)]
        for each in looked:
            maps = BASE_ALONE if each.maps == BASE_ALONE else each.maps
            found[each.ref] = replace(each, maps=maps, stamp=None)
        if plain:
            # Without a stamp the time of an image cannot be trusted. JSON holds no path that is not Unicode.
            run.library.remember(
                {
                    each.ref.path: ImageFile(each.stamp, each.pixel_hash, each.width, each.height, each.channels)
                    for each in looked
                    if each.ref.index is None and each.stamp is not None and each.ref.path.isprintable()
                }
            )
        run.advance(len(result), len(result))

    jobs: Iterator[WorkJob] = (
        LookJob(tuple(due[first : first + LOOKED_TOGETHER]), reading, features)
        for first in range(0, len(due), LOOKED_TOGETHER)
    )
    for failure in run_jobs(run.workers, jobs, take, run.stopped, run.tried_again, _halves):
        run.fail(_refs(failure.argument), failure.problem)
    return [found[ref] for ref in refs if ref in found]


def _refs(job: WorkJob) -> tuple[TextureRef, ...]:
    return job.refs if isinstance(job, LookJob) else tuple(each.ref for each in job.textures)


def _texels(job: WorkJob) -> int:
    return sum(each.width * each.height for each in job.textures) if isinstance(job, EncodeJob) else 0


def _halves(job: WorkJob) -> list[WorkJob]:
    """Return two jobs that do the same together; none where it has one texture."""
    refs = _refs(job)
    middle = len(refs) // 2
    if middle == 0:
        return []
    if isinstance(job, LookJob):
        return [replace(job, refs=refs[:middle]), replace(job, refs=refs[middle:])]
    hashes = [each.pixel_hash for each in job.textures]
    halves = (without(job, frozenset(hashes[middle:])), without(job, frozenset(hashes[:middle])))
    return [half for half in halves if half is not None]


def _encode_all(run: _Run, jobs: Sequence[EncodeJob]) -> None:
    stored = run.library.textures
    due = list[WorkJob]()
    for job in jobs:
        held = frozenset(each.pixel_hash for each in job.textures if (job.settings, each.pixel_hash) in stored)
        left = without(job, held)
        due += [] if left is None else [left]
    weights = [(len(_refs(job)), _texels(job)) for job in due]
    run.begin("encoding", sum(count for count, _ in weights), sum(texels for _, texels in weights))

    def take(job: WorkJob, result: WorkResult) -> None:
        assert isinstance(result, bytes)
        run.library.add(result)
        run.result.encoded += len(_refs(job))
        run.result.texels += _texels(job)
        run.advance(len(_refs(job)), _texels(job))

    for failure in run_jobs(run.workers, due, take, run.stopped, run.tried_again, _halves):
        run.fail(_refs(failure.argument), failure.problem)
    for job in jobs:
        for each in job.textures:
            found = stored.get((job.settings, each.pixel_hash))
            if found is not None:
                run.result.stored.append(Stored(each.ref, found[1]))


def encode_to_library(
    request: EncodeRequest,
    refs: Sequence[TextureRef],
    workers: Workers[WorkJob, WorkResult],
    folder: Path,
    listen: Callable[[RunProgress], None] = lambda _progress: None,
    stopped: Callable[[], bool] = lambda: False,
) -> RunResult:
    """Encode `refs` into the library in `folder`, which is made where there is none; what it holds is not encoded again.

    The same textures and `request` give the same packs with any workers, whichever job ends first. Ends early where `stopped` says so:
    what is done is kept. Raises InputError for what cannot be asked, and for a folder that cannot be written,
    in the middle of the run too: a full disk.
    """
    began, result = time.monotonic(), RunResult(len(refs))
    library = Library.to_write(folder)
    run = _Run(request, workers, library, listen, stopped, result)
    looked = _look_at_all(run, refs)
    library.save()
    result.constant = sum(not each.pixel_hash for each in looked)
    named = [each for each in looked if each.pixel_hash]
    unique = list({each.pixel_hash: each for each in reversed(named)}.values())[::-1]
    result.repeated = len(named) - len(unique)
    if not stopped():
        jobs = encode_jobs(request, unique)
        result.settings = tuple(sorted({job.settings for job in jobs}))
        _encode_all(run, jobs)
    library.save()
    result.stopped, result.seconds = stopped(), time.monotonic() - began
    return result
