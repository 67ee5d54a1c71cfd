"""The scheduler of a frame: it runs the passes that have something to do, times them, and counts what it skipped."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from itertools import count
from typing import Generic, Literal, Protocol, TypeVar
from weakref import WeakKeyDictionary

from viewer.gl.timer import PassTimer
from viewer.scene.json_text import counted

Inputs_contra = TypeVar("Inputs_contra", contravariant=True)
Target_contra = TypeVar("Target_contra", contravariant=True)
Inputs = TypeVar("Inputs")
Target = TypeVar("Target")

Timing = Callable[[str], AbstractContextManager[None]]
"""Function that takes the time of a block under a name."""
Part = Literal["textures", "images", "tiles", "loads", "samples", "packs", "statistics", "environment"]
SENTENCES: dict[Part, str] = {
    "textures": "{} being read",
    "images": "{} being read",
    "tiles": "{} being decoded",
    "loads": "{} being compressed",
    "samples": "{} being drawn",
    "packs": "{} being uploaded",
    "statistics": "decoders are being counted",
    "environment": "the environment is being filtered",
}


@dataclass(frozen=True)
class ToCome:
    """Part of a picture that later frames add."""

    part: Part
    left: int
    """Number that is still to come, at least 1."""
    total: int = 0
    """Number in all; 0 where that is not known."""

    @property
    def line(self) -> str:
        """Line for people, such as "3 of 41 textures are being read"."""
        noun = "texture" if self.part == "loads" else self.part.removesuffix("s")
        number = f"{self.left:,} of {counted(self.total, noun)}" if self.total else counted(self.left, noun)
        return SENTENCES[self.part].format(f"{number} {'is' if self.left == 1 else 'are'}")


@dataclass(frozen=True)
class Output:
    """Content of a target after a pass."""

    version: int
    """Number that changes whenever the content may have changed; no two targets share one."""
    to_come: tuple[ToCome, ...] = ()
    """Parts that later frames add; empty where the content is complete."""

    @property
    def is_complete(self) -> bool:
        """True where running the passes again would change nothing."""
        return not self.to_come


@dataclass(frozen=True)
class Step:
    """Circumstances of one run of a pass that works in parts."""

    whole: bool
    """True where nothing may be left for later frames."""
    is_same_view: bool
    """True where the target shows an earlier state of equal inputs."""
    is_stale: bool
    """True where an output that the pass reads has another version than at the last run."""


@dataclass(frozen=True)
class Progress:
    """Result of one run of a pass that works in parts."""

    has_changed: bool = True
    """True where the target may show something else than before."""
    to_come: tuple[ToCome, ...] = ()


class RenderPass(Protocol[Inputs_contra, Target_contra]):
    """Pass of a frame. It knows no other pass; its settings are given when it is made.

    Inputs are a frozen dataclass: equal inputs, and equal versions of what is read, give the same content of the same target. Fields
    that follow from the others do not take part in the comparison.
    """

    @property
    def name(self) -> str:
        """Name of its time in `FrameResult.timings_ms`."""

    def run(self, inputs: Inputs_contra, target: Target_contra, /) -> None:
        """Write all of `target`."""


class ProgressivePass(Protocol[Inputs_contra, Target_contra]):
    """Pass of a frame whose target becomes complete over several frames."""

    @property
    def name(self) -> str:
        """Name of its time in `FrameResult.timings_ms`."""

    def advance(self, inputs: Inputs_contra, target: Target_contra, step: Step, /) -> Progress:
        """Do a frame's share of the work."""


@dataclass(frozen=True)
class Wanted(Generic[Inputs, Target]):
    """One of the targets that a JointPass draws."""

    inputs: Inputs
    target: Target
    reads: Sequence[Output]
    owner: Hashable
    """Owner of its share of the time (`PassTimer.owned_by`)."""


class JointPass(Protocol[Inputs_contra, Target_contra]):
    """Pass that draws several targets at once, each of which becomes complete over several frames."""

    @property
    def name(self) -> str:
        """Name of its time in `FrameResult.timings_ms`."""

    def advance_all(self, wanted: Sequence[tuple[Inputs_contra, Target_contra, Step]], /) -> Sequence[Progress]:
        """Do a frame's share of the work for each of these targets."""


@dataclass(frozen=True)
class _Record:
    """Inputs and versions from which the content of a target was made."""

    inputs: object
    reads: tuple[int, ...]
    """Versions of the outputs that were read."""
    version: int
    own: tuple[ToCome, ...] = ()
    """Parts that the pass itself has still to add."""


def largest_of_each(items: Iterable[ToCome]) -> tuple[ToCome, ...]:
    """Return one item for each part: the one with most left."""
    found = dict[Part, ToCome]()
    for item in items:
        if item.part not in found or item.left > found[item.part].left:
            found[item.part] = item
    return tuple(found[part] for part in SENTENCES if part in found)


class PassScheduler:
    """Scheduler that runs all passes. It remembers what each target was made from, for as long as the target exists."""

    def __init__(self, timer: PassTimer) -> None:
        self.timer = timer
        self.whole = False
        """True while passes may leave nothing for later frames."""
        self.skipped: Counter[str] = Counter()
        """Numbers of what was skipped since `take_skipped`, by name."""
        self.ran = 0
        """Number of runs of passes so far."""
        self._records: WeakKeyDictionary[object, _Record] = WeakKeyDictionary()
        self._versions = count(1)

    @contextmanager
    def drawing(self, whole: bool) -> Iterator[None]:
        """Leave nothing for later frames within the block, if `whole`."""
        before, self.whole = self.whole, whole
        try:
            yield
        finally:
            self.whole = before

    def run(
        self,
        render_pass: RenderPass[Inputs, Target],
        inputs: Inputs,
        target: Target,
        reads: Sequence[Output] = (),
        timing: Timing | None = None,
    ) -> Output:
        """Run the pass, unless `target` was made from equal inputs and the same versions of `reads`; return what `target` holds.

        `timing`: how its time is taken; None: `PassTimer.measure`.
        """
        record = self._take(inputs, target, reads)
        if isinstance(record, Output):
            return record
        with (timing or self.timer.measure)(render_pass.name):
            render_pass.run(inputs, target)
        return self._note(target, _Record(inputs, _versions_of(reads), next(self._versions)), reads)

    def advance(
        self,
        render_pass: ProgressivePass[Inputs, Target],
        inputs: Inputs,
        target: Target,
        reads: Sequence[Output] = (),
        timing: Timing | None = None,
    ) -> Output:
        """Run a pass that works in parts, in each frame until its target is complete; return what `target` holds."""
        before = self._take(inputs, target, reads)
        if isinstance(before, Output):
            return before
        step = self._step(before, inputs, reads)
        with (timing or self.timer.measure)(render_pass.name):
            done = render_pass.advance(inputs, target, step)
        return self._note_progress(before, target, inputs, reads, done)

    def advance_all(
        self, render_pass: JointPass[Inputs, Target], wanted: Sequence[Wanted[Inputs, Target]]
    ) -> list[Output]:
        """As `advance`, for several targets of one pass: those that have something to do are drawn at once, and share its time."""
        found = [self._take(own.inputs, own.target, own.reads) for own in wanted]
        outputs = {own.owner: taken for own, taken in zip(wanted, found, strict=True) if isinstance(taken, Output)}
        stale = [(own, before) for own, before in zip(wanted, found, strict=True) if not isinstance(before, Output)]
        if stale:
            parts = [(own.inputs, own.target, self._step(before, own.inputs, own.reads)) for own, before in stale]
            with self.timer.owned_by(*(own.owner for own, _ in stale)), self.timer.measure(render_pass.name):
                done = render_pass.advance_all(parts)
            for (own, before), progress in zip(stale, done, strict=True):
                outputs[own.owner] = self._note_progress(before, own.target, own.inputs, own.reads, progress)
        return [outputs[own.owner] for own in wanted]

    def _take(self, inputs: object, target: object, reads: Sequence[Output]) -> Output | _Record | None:
        """Return the output where nothing is to be done; else the record of `target`, which is forgotten until the pass has run."""
        record = self._records.get(target)
        if record is not None and not record.own and record.inputs == inputs and record.reads == _versions_of(reads):
            self.skipped["passes"] += 1
            return _output(record, reads)
        # The pass may raise.
        self.invalidate(target)
        self.ran += 1
        return record

    def _step(self, before: _Record | None, inputs: object, reads: Sequence[Output]) -> Step:
        is_same = before is not None and before.inputs == inputs
        return Step(self.whole, is_same, before is not None and before.reads != _versions_of(reads))

    def _note_progress(
        self, before: _Record | None, target: object, inputs: object, reads: Sequence[Output], done: Progress
    ) -> Output:
        stays = before is not None and before.inputs == inputs and not done.has_changed
        version = before.version if before is not None and stays else next(self._versions)
        return self._note(target, _Record(inputs, _versions_of(reads), version, done.to_come), reads)

    def _note(self, target: object, record: _Record, reads: Sequence[Output]) -> Output:
        self._records[target] = record
        return _output(record, reads)

    def invalidate(self, target: object) -> None:
        """Forget the content of `target`: the next `run` runs."""
        self._records.pop(target, None)

    def forget(self) -> None:
        """Leave what has run and what was skipped since the last frame out of the next frame's figures."""
        self.timer.forget()
        self.skipped.clear()

    def take_skipped(self) -> dict[str, int]:
        """Return what was skipped since the last call, by name."""
        skipped, self.skipped = dict(self.skipped), Counter()
        return skipped


def _versions_of(reads: Sequence[Output]) -> tuple[int, ...]:
    return tuple(output.version for output in reads)


def _output(record: _Record, reads: Sequence[Output]) -> Output:
    return Output(record.version, record.own + tuple(item for output in reads for item in output.to_come))
