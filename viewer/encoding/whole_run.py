"""Encoding a set of textures into a library: look at them, plan, encode, keep what comes. Begun again, it does what is left to do."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ntc.codec.maps import BASE_ALONE, MapName
from ntc.errors import InputError
from ntc.library.records import ImageFile, StoredTexture
from ntc.library.writer import LibraryWriter
from viewer.encoding.plan import Asked, encode_jobs, needs_features, without
from viewer.encoding.sources import TextureRef, stamp_of
from viewer.encoding.work import Encoded, EncodeJob, Looked, LookJob, Unread, WorkJob, WorkResult
from viewer.jobs.executor import MOST_ATTEMPTS, Executor, run_jobs

LOOKED_TOGETHER = 32
"""Images of one job that looks at them."""
Phase = Literal["looking at", "encoding"]


@dataclass(frozen=True)
class RunProgress:
    """How far a run is."""

    phase: Phase
    done: int
    """Textures."""
    of: int
    share: float
    """Of the work, 0 to 1: by texels where they are known."""
    seconds_left: float
    texels_per_second: float
    failures: int
    note: str = ""
    """A job that was begun once more, and why."""


@dataclass(frozen=True, slots=True)
class Stored:
    """A texture that the library holds."""

    ref: TextureRef
    texture: StoredTexture
    shard: str
    """Digest."""


@dataclass
class RunResult:
    """What came of a run."""

    asked: int
    """Textures that were named."""
    constant: int = 0
    """Images of one colour, which need no encoding."""
    stored: list[Stored] = field(default_factory=list)
    """In the order of the textures; those with equal pixels once."""
    repeated: int = 0
    """Textures with the pixels of another one."""
    encoded: int = 0
    """Of those stored: in this run."""
    failed: dict[str, str] = field(default_factory=dict)
    """By path, and in a scene name: why a texture is missing."""
    tried_again: int = 0
    """Jobs that were begun once more."""
    stopped: bool = False
    """By Ctrl-C."""
    seconds: float = 0.0
    texels: int = 0
    """That were encoded in this run."""
    settings: tuple[str, ...] = ()
    """Keys by which the library holds the textures."""


def _name(ref: TextureRef) -> str:
    return ref.path if ref.index is None else f"{ref.path}: {ref.name}"


class _Run:
    """One run, while it goes on."""

    def __init__(
        self,
        asked: Asked,
        executor: Executor[WorkJob, WorkResult],
        writer: LibraryWriter,
        listen: Callable[[RunProgress], None],
        stopped: Callable[[], bool],
        result: RunResult,
    ) -> None:
        self.asked, self.executor, self.writer, self.result = asked, executor, writer, result
        self._listen, self.stopped = listen, stopped
        self._began, self._phase = time.monotonic(), "looking at"
        self._done = self._of = self._weight_done = self._weight = 0

    def begin(self, phase: Phase, textures: int, weight: int) -> None:
        """A phase of so many textures, and so much work."""
        self._phase, self._began = phase, time.monotonic()
        self._done, self._of, self._weight_done, self._weight = 0, textures, 0, weight

    def advance(self, textures: int, weight: int, note: str = "") -> None:
        """So much more is done."""
        self._done += textures
        self._weight_done += weight
        seconds = max(time.monotonic() - self._began, 1e-6)
        share = self._weight_done / max(self._weight, 1)
        left = seconds * (1.0 - share) / share if share > 0.0 else 0.0
        failures = len(self.result.failed)
        phase: Phase = "encoding" if self._phase == "encoding" else "looking at"
        self._listen(RunProgress(phase, self._done, self._of, share, left, self._weight_done / seconds, failures, note))

    def tried_again(self, problem: str) -> None:
        """A job is begun once more."""
        self.result.tried_again += 1
        self.advance(0, 0, problem)

    def fail(self, refs: Sequence[TextureRef], problem: str) -> None:
        """These textures will be missing."""
        self.result.failed.update((_name(ref), problem) for ref in refs)


def _unread(run: _Run, problems: Unread, attempt: int) -> str | None:
    """One line where images are to be tried again; None where that has been done often enough, and they have been named."""
    if attempt + 1 < MOST_ATTEMPTS:
        return next(iter(problems.problems.values()))
    for ref, problem in problems.problems.items():
        run.fail([ref], problem)
    return None


def _look_at_all(run: _Run, refs: Sequence[TextureRef]) -> list[Looked]:
    """What each of `refs` is; those that fail are left out and named."""
    reading, found = run.asked.reading, dict[TextureRef, Looked]()
    features = run.asked.grouping.features if needs_features(run.asked) else None
    plain = features is None and reading.texture_size is None
    for ref in refs:
        known = run.writer.index.files.get(ref.path) if plain and ref.index is None else None
        if known is not None and (known.bytes, known.modified_ns) == stamp_of(ref.path):
            found[ref] = Looked(ref, known.pixel_hash, known.width, known.height, known.channels)
    due = [ref for ref in refs if ref not in found]
    run.begin("looking at", len(due), len(due))

    def take(job: WorkJob, result: WorkResult, attempt: int) -> WorkJob | str | None:
        if isinstance(result, Unread):
            again = _unread(run, result, attempt)
            if again is not None:
                return again
            run.advance(len(result.problems), len(result.problems))
            left = tuple(ref for ref in _refs(job) if ref not in result.problems)
            return LookJob(left, reading, features) if left else None
        assert isinstance(result, tuple)
        # Texts that came with a message would be held a second time.
        own = [replace(each, ref=ref) for each, ref in zip(result, _refs(job), strict=True)]
        found.update((each.ref, replace(each, maps=_shared(each.maps), stamp=None)) for each in own)
        if plain:
            files = [_image_file(each) for each in own if each.ref.index is None]
            run.writer.remember([file for file in files if file is not None])
        run.advance(len(result), len(result))
        return None

    jobs: Iterator[WorkJob] = (
        LookJob(tuple(due[first : first + LOOKED_TOGETHER]), reading, features)
        for first in range(0, len(due), LOOKED_TOGETHER)
    )
    for failure in run_jobs(run.executor, jobs, take, run.stopped, run.tried_again, _halves):
        run.fail(_refs(failure.argument), failure.problem)
    return [found[ref] for ref in refs if ref in found]


def _refs(job: WorkJob) -> tuple[TextureRef, ...]:
    return job.refs if isinstance(job, LookJob) else tuple(each.ref for each in job.textures)


def _halves(job: WorkJob) -> list[WorkJob]:
    """Two jobs that do the same together; none where it has one texture."""
    refs = _refs(job)
    middle = len(refs) // 2
    if middle == 0:
        return []
    if isinstance(job, LookJob):
        return [replace(job, refs=refs[:middle]), replace(job, refs=refs[middle:])]
    hashes = [each.pixel_hash for each in job.textures]
    halves = (without(job, frozenset(hashes[middle:])), without(job, frozenset(hashes[:middle])))
    return [half for half in halves if half is not None]


def _shared(maps: tuple[MapName, ...]) -> tuple[MapName, ...]:
    return BASE_ALONE if maps == BASE_ALONE else maps


def _image_file(looked: Looked) -> ImageFile | None:
    """What is remembered of an image; None where its time cannot be trusted."""
    if looked.stamp is None:
        return None
    return ImageFile(looked.ref.path, *looked.stamp, looked.pixel_hash, looked.width, looked.height, looked.channels)


def _encode_all(run: _Run, jobs: Sequence[EncodeJob]) -> None:
    index = run.writer.index
    due = [job for job in (_left(run, job) for job in jobs) if job is not None]
    run.begin("encoding", sum(len(job.textures) for job in due), sum(job.texels for job in due))
    arguments: list[WorkJob] = list(due)

    def take(job: WorkJob, result: WorkResult, attempt: int) -> WorkJob | str | None:
        assert isinstance(job, EncodeJob)
        if isinstance(result, Unread):
            again = _unread(run, result, attempt)
            if again is not None:
                return again
            lost = frozenset(each.pixel_hash for each in job.textures if each.ref in result.problems)
            run.advance(len(lost), sum(t.width * t.height for t in job.textures if t.pixel_hash in lost))
            return without(job, lost)
        assert isinstance(result, Encoded)
        try:
            run.writer.add(result.shard, result.data)
        except InputError as error:
            return str(error)
        run.result.encoded += len(job.textures)
        run.result.texels += job.texels
        run.advance(len(job.textures), job.texels)
        return None

    for failure in run_jobs(run.executor, arguments, take, run.stopped, run.tried_again, _halves):
        assert isinstance(failure.argument, EncodeJob)
        run.fail(_refs(failure.argument), failure.problem)
    for job in jobs:
        run.result.stored += list(_stored(run, job, index.places))


def _left(run: _Run, job: EncodeJob) -> EncodeJob | None:
    """What of `job` the library lacks."""
    held = {each.pixel_hash for each in job.textures if run.writer.index.holds(job.settings, each.pixel_hash)}
    return without(job, frozenset(held))


def _stored(run: _Run, job: EncodeJob, places: dict[tuple[str, str], str]) -> Iterator[Stored]:
    for each in job.textures:
        digest = places.get((job.settings, each.pixel_hash))
        if digest is not None:
            own = next(t for t in run.writer.index.shards[digest].textures if t.pixel_hash == each.pixel_hash)
            yield Stored(each.ref, own, digest)


def encode_to_library(
    asked: Asked,
    refs: Sequence[TextureRef],
    executor: Executor[WorkJob, WorkResult],
    folder: Path,
    listen: Callable[[RunProgress], None] = lambda _progress: None,
    stopped: Callable[[], bool] = lambda: False,
) -> RunResult:
    """Encode `refs` into the library in `folder`, which is made where there is none; what it holds is not encoded again.

    The same textures and `asked` give the same shards in any executor, whichever job ends first. Ends early where `stopped` says so:
    what is done is kept. Raises InputError for what cannot be asked, and for a folder that cannot be written.
    """
    began, result = time.monotonic(), RunResult(len(refs))
    with LibraryWriter(folder) as writer:
        run = _Run(asked, executor, writer, listen, stopped, result)
        looked = _look_at_all(run, refs)
        result.constant = sum(not each.pixel_hash for each in looked)
        named = [each for each in looked if each.pixel_hash]
        unique = list({each.pixel_hash: each for each in reversed(named)}.values())[::-1]
        result.repeated = len(named) - len(unique)
        if not stopped():
            jobs = encode_jobs(asked, unique)
            result.settings = tuple(sorted({job.settings for job in jobs}))
            _encode_all(run, jobs)
    result.stopped, result.seconds = stopped(), time.monotonic() - began
    return result
