"""Encoding of a set of textures into a library, by jobs.

A run has three steps: read each image for its hash, size and features; group the textures and cut the groups into jobs; encode the
jobs that the library does not hold yet, and add each pack as it comes. A second run therefore encodes only what is missing.

Jobs depend on the textures and the request alone, never on the number of workers or on earlier runs, so any run gives the same bytes.
A group of more than LARGEST_JOB texels is cut into several jobs, each with a decoder.
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
    InspectJob,
    ReadOptions,
    TextureRef,
    WorkJob,
    WorkResult,
    blank,
    stamp_of,
)
from viewer.jobs.executor import Workers, run_jobs

JOB_TEXELS = 1 << 24
"""Texels of mip 0 of a job, about: codec `block` encodes them in tens of seconds on one core."""
LARGEST_JOB = 2 * JOB_TEXELS
"""Most texels of a group that is not cut into several jobs."""
MOST_TEXTURES = 64
"""Most textures of a job whose textures share no trained decoder."""
LIBRARY_TEXTURE = (1024, 1024)
"""Texture size that the codec's settings of a library are chosen for: they must not change when textures are added."""
LIBRARY_GROUP = 8
"""Number of textures in a group that these settings are chosen for."""
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
    """True if all textures become one pack with the same codec settings."""
    decoders: Path | None = None
    """Pack whose decoders, codec and grouping are used. None: new decoders."""


@dataclass(frozen=True, order=True)
class _Kind:
    """Kind of textures that share codec settings."""

    maps: tuple[MapName, ...]
    channels: int


def needs_features(request: EncodeRequest) -> bool:
    """Return whether the grouping compares textures by features."""
    return request.grouping.name in ("clustered", "random")


def without_pixels(texture: ImageInfo) -> SourceTexture:
    """Return a texture with the fields of `texture` and zero pixels that take no memory."""
    pixels = blank((texture.height, texture.width, texture.channels))
    return SourceTexture(texture.ref.name, pixels, texture.pixel_hash, category=texture.ref.category, maps=texture.maps)


def _grouping(request: EncodeRequest, textures: Sequence[ImageInfo]) -> Grouping:
    config = request.grouping
    if config.name == UNIVERSAL:
        # Whole materials are grouped by their pixels, which only the job reads.
        return Grouping(UNIVERSAL, (0,) * len(textures), dict(codec_named(shipping_codec()).shipped))
    without_texels = [without_pixels(texture) for texture in textures]
    if needs_features(request) and config.clusters is None:
        texels = sum(each.width * each.height for each in textures)
        most = min(max(DEFAULT_CLUSTERS, math.ceil(texels / JOB_TEXELS)), len(textures))
        config = replace(config, clusters=most)
    known = {each.pixel_hash: np.array(each.features) for each in textures} if needs_features(request) else {}
    labels = read_labels(request.labels, without_texels) if request.labels is not None else {}
    return make_grouping(config, without_texels, GroupingInputs(labels=labels, features=FeatureOptions(known=known)))


def _codec(request: EncodeRequest, kind: _Kind, sizes: Sequence[tuple[int, int]], groups: int) -> CodecSettings:
    known = TextureSet(sizes, groups, kind.channels, request.choices.levels, kind.maps)
    return codec_named(request.codec).settings_for(known, request.choices)


def _library_codec(request: EncodeRequest, kind: _Kind) -> CodecSettings:
    alone = {UNIVERSAL: 0, "baseline": LIBRARY_GROUP}
    return _codec(request, kind, [LIBRARY_TEXTURE] * LIBRARY_GROUP, alone.get(request.grouping.name, 1))


def _options(request: EncodeRequest) -> EncodingOptions:
    return codec_named(request.codec).job_options_for(request.choices)


def _settings(request: EncodeRequest, config: CodecSettings) -> str:
    """Return the key of all settings that a texture's encoded bytes depend on, besides the pixels of its group."""
    grouping = replace(request.grouping, clusters=None)
    training = codec_of(config).recorded_options(_options(request))
    request_json = {"reading": asdict(request.reading), "grouping": asdict(grouping), "training": training}
    return settings_key(config, request.grouping.name, request_json)


def encode_jobs(request: EncodeRequest, textures: Sequence[ImageInfo]) -> list[EncodeJob]:
    """Return the jobs that encode all `textures`, which have distinct pixel hashes and are not constant.

    Raises InputError for invalid settings, a grouping that needs views of the scene, and decoders that cannot be read.
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
        job_grouping = Grouping.of_labels(grouping.name, [group for _, group in part], grouping.parameters)
        chosen = tuple(textures[index] for index, _ in part)
        jobs.append(EncodeJob(chosen, request.reading, job_grouping, configs[kind], _options(request), keys[kind]))
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
    by_kind: dict[_Kind, list[int]] = {}
    for index, each in enumerate(textures):
        base_alone = each.maps == ("base",)
        channels = common_channels(each.channels) if base_alone else each.channels
        by_kind.setdefault(_Kind(each.maps, channels), []).append(index)
    return by_kind


def _parts(
    grouping: Grouping, members: Sequence[int], textures: Sequence[ImageInfo]
) -> Iterator[list[tuple[int, int]]]:
    """Yield the (texture, group) pairs of each job. Groups stay whole up to LARGEST_JOB; textures without a shared decoder, or with
    the decoder that ships with the program, come in chunks of JOB_TEXELS."""
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
        texels_of_texture = textures[index].width * textures[index].height
        if chunk and (texels + texels_of_texture > most_texels or len(chunk) >= most):
            yield chunk
            chunk, texels = [], 0
        chunk.append((index, group))
        texels += texels_of_texture
    yield chunk


def without_held(job: EncodeJob, held: frozenset[str]) -> EncodeJob | None:
    """Return the job without the textures whose pixel hashes are in `held`; None where none is left."""
    left = [number for number, each in enumerate(job.textures) if each.pixel_hash not in held]
    if len(left) == len(job.textures):
        return job
    if not left:
        return None
    groups = [job.grouping.groups[number] for number in left]
    grouping = Grouping.of_labels(job.grouping.name, groups, job.grouping.parameters)
    return replace(job, textures=tuple(job.textures[number] for number in left), grouping=grouping)


IMAGES_PER_JOB = 32
"""Images of a job that reads their facts."""
Phase = Literal["looking at", "encoding"]


@dataclass(frozen=True)
class RunProgress:
    """Progress of a run, phase by phase."""

    phase: Phase
    done: int
    """Number of textures done in this phase."""
    of: int
    share: float
    """Progress of the phase, 0 to 1; by texels while encoding."""
    texels_per_second: float
    failures: int
    note: str = ""
    """Reason why a job was retried; "" for none."""


@dataclass(frozen=True, slots=True)
class Stored:
    """Texture that the library holds, with its source."""

    ref: TextureRef
    texture: StoredTexture


@dataclass
class RunResult:
    """Result of a run."""

    asked: int
    """Number of textures in the request."""
    constant: int = 0
    """Number of images of one colour, which need no encoding."""
    stored: list[Stored] = field(default_factory=list)
    """Textures of the request that the library holds, in order, without duplicates."""
    repeated: int = 0
    """Number of textures with the pixels of another one."""
    encoded: int = 0
    """Number of textures that were encoded in this run."""
    failed: dict[str, str] = field(default_factory=dict)
    """Reason why a texture is missing, by path; for a texture of a scene by path and name."""
    tried_again: int = 0
    """Number of retries of jobs."""
    stopped: bool = False
    """True if Ctrl-C stopped the run."""
    seconds: float = 0.0
    texels: int = 0
    """Number of texels that were encoded in this run."""
    settings: tuple[str, ...] = ()
    """Keys of the textures' settings in the library."""


class _Run:
    """State of a run: its workers, library, progress and result."""

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
        """Begin a phase with a number of textures and a total weight of work."""
        self._phase, self._began = phase, time.monotonic()
        self._done, self._of, self._weight_done, self._weight = 0, textures, 0, weight

    def advance(self, textures: int, weight: int, note: str = "") -> None:
        """Add textures and weight of work to what is done, and report the progress."""
        self._done += textures
        self._weight_done += weight
        now = time.monotonic()
        seconds = max(now - self._began, 1e-6)
        share = self._weight_done / max(self._weight, 1)
        failures = len(self.result.failed)
        self._listen(RunProgress(self._phase, self._done, self._of, share, self._weight_done / seconds, failures, note))

    def tried_again(self, problem: str) -> None:
        """Count and report the retry of a job."""
        self.result.tried_again += 1
        self.advance(0, 0, problem)

    def fail(self, refs: Sequence[TextureRef], problem: str) -> None:
        """Record the reason why textures are missing."""
        for ref in refs:
            self.result.failed[ref.path if ref.index is None else f"{ref.path}: {ref.name}"] = problem


def _inspect_all(run: _Run, refs: Sequence[TextureRef]) -> list[ImageInfo]:
    """Return the facts of each of `refs`, from the library or by jobs. Those that fail are recorded and left out."""
    reading, facts = run.request.reading, dict[TextureRef, ImageInfo]()
    features = run.request.grouping.features if needs_features(run.request) else None
    plain = features is None and reading.texture_size is None
    for ref in refs:
        known = run.library.images.get(ref.path) if plain and ref.index is None else None
        if known is not None and known.stamp == stamp_of(ref.path):
            facts[ref] = ImageInfo(ref, known.pixel_hash, known.width, known.height, known.channels)
    due = [ref for ref in refs if ref not in facts]
    run.begin("looking at", len(due), len(due))

    def take(job: WorkJob, result: WorkResult) -> None:
        assert isinstance(result, tuple)
        # The result of the job holds copies of the references; ours replace them, to save memory.
        inspected = [replace(each, ref=ref) for each, ref in zip(result, _refs(job), strict=True)]
        for each in inspected:
            maps = BASE_ALONE if each.maps == BASE_ALONE else each.maps
            facts[each.ref] = replace(each, maps=maps, stamp=None)
        if plain:
            # An image without a stamp was changing while it was read. A path that is not Unicode does not fit into JSON.
            run.library.remember(
                {
                    each.ref.path: ImageFile(each.stamp, each.pixel_hash, each.width, each.height, each.channels)
                    for each in inspected
                    if each.ref.index is None and each.stamp is not None and each.ref.path.isprintable()
                }
            )
        run.advance(len(result), len(result))

    jobs: Iterator[WorkJob] = (
        InspectJob(tuple(due[first : first + IMAGES_PER_JOB]), reading, features)
        for first in range(0, len(due), IMAGES_PER_JOB)
    )
    for failure in run_jobs(run.workers, jobs, take, run.stopped, run.tried_again, _halves):
        run.fail(_refs(failure.argument), failure.problem)
    return [facts[ref] for ref in refs if ref in facts]


def _refs(job: WorkJob) -> tuple[TextureRef, ...]:
    return job.refs if isinstance(job, InspectJob) else tuple(each.ref for each in job.textures)


def _texels(job: WorkJob) -> int:
    return sum(each.width * each.height for each in job.textures) if isinstance(job, EncodeJob) else 0


def _halves(job: WorkJob) -> list[WorkJob]:
    """Return the job cut into two; none where it has one texture."""
    refs = _refs(job)
    middle = len(refs) // 2
    if middle == 0:
        return []
    if isinstance(job, InspectJob):
        return [replace(job, refs=refs[:middle]), replace(job, refs=refs[middle:])]
    hashes = [each.pixel_hash for each in job.textures]
    halves = (without_held(job, frozenset(hashes[middle:])), without_held(job, frozenset(hashes[:middle])))
    return [half for half in halves if half is not None]


def _encode_all(run: _Run, jobs: Sequence[EncodeJob]) -> None:
    stored = run.library.textures
    due = list[WorkJob]()
    for job in jobs:
        held = frozenset(each.pixel_hash for each in job.textures if (job.settings, each.pixel_hash) in stored)
        left = without_held(job, held)
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
            entry = stored.get((job.settings, each.pixel_hash))
            if entry is not None:
                run.result.stored.append(Stored(each.ref, entry[1]))


def encode_to_library(
    request: EncodeRequest,
    refs: Sequence[TextureRef],
    workers: Workers[WorkJob, WorkResult],
    folder: Path,
    listen: Callable[[RunProgress], None] = lambda _progress: None,
    stopped: Callable[[], bool] = lambda: False,
) -> RunResult:
    """Encode `refs` into the library in `folder`, which is made if needed. Textures that it holds are not encoded again.

    The same textures and `request` give the same packs with any workers, in any order of jobs. The run ends early when `stopped`
    returns True; finished jobs stay in the library. Raises InputError for an invalid request, and for a folder that cannot be
    written, also in the middle of the run (disk full).
    """
    began, result = time.monotonic(), RunResult(len(refs))
    library = Library.to_write(folder)
    run = _Run(request, workers, library, listen, stopped, result)
    inspected = _inspect_all(run, refs)
    library.save()
    result.constant = sum(not each.pixel_hash for each in inspected)
    varied = [each for each in inspected if each.pixel_hash]
    unique = list({each.pixel_hash: each for each in reversed(varied)}.values())[::-1]
    result.repeated = len(varied) - len(unique)
    if not stopped():
        jobs = encode_jobs(request, unique)
        result.settings = tuple(sorted({job.settings for job in jobs}))
        _encode_all(run, jobs)
    library.save()
    result.stopped, result.seconds = stopped(), time.monotonic() - began
    return result
