"""Scheduler of passes: it runs those whose inputs have changed, times them, and counts the skipped ones.

A pass is a function of its inputs, and of the contents of the outputs that it reads. The scheduler keeps, for each target, the inputs
and the versions of those outputs from its last run. If both are equal now, the target holds the right content and the pass is
skipped; else the pass runs and the target gets a new version. So a change reaches exactly the passes that depend on it. This is
memoisation by version numbers, as build systems do it: nobody marks anything dirty by hand.

A pass may take several frames, such as one that decodes tiles. It then reports what is pending, runs again in the next frame with a
frame's share of the budget, and its output is incomplete until nothing is pending (docs/explanation/architecture.md#a-frame).
"""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import IntEnum
from itertools import count
from typing import Generic, Literal, TypeVar
from weakref import WeakKeyDictionary

from viewer.gl.timer import PassTimer
from viewer.scene.json_text import counted

Inputs = TypeVar("Inputs")
Target = TypeVar("Target")

Timing = Callable[[str], AbstractContextManager[None]]
"""Function that measures the time of a block under a name."""
Part = Literal["textures", "images", "tiles", "loads", "samples", "packs", "statistics", "environment"]
NOT_OWNED = nullcontext()
"""Context for a pass whose time belongs to no single slot or plane."""
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
class Pending:
    """Part of a picture that later frames add."""

    part: Part
    left: int
    """Number of items that are still missing, at least 1."""
    total: int = 0
    """Number of all items; 0 if it is not known."""

    @property
    def line(self) -> str:
        """Message line, such as "3 of 41 textures are being read"."""
        noun = "texture" if self.part == "loads" else self.part.removesuffix("s")
        number = f"{self.left:,} of {counted(self.total, noun)}" if self.total else counted(self.left, noun)
        return SENTENCES[self.part].format(f"{number} {'is' if self.left == 1 else 'are'}")


@dataclass(frozen=True)
class Output:
    """Content of a target after a pass."""

    version: int
    """Number that changes whenever the content may have changed; no two targets share one."""
    pending: tuple[Pending, ...] = ()
    """Parts that later frames add; empty where the content is complete."""

    @property
    def is_complete(self) -> bool:
        """True if running the passes again would change nothing."""
        return not self.pending


class Budget(IntEnum):
    """Part of the pending work that a frame does."""

    SHARE = 0
    """A frame's share of the work. Results that the GPU has not delivered yet are used in a later frame."""
    ANSWERS = 1
    """A frame's share of the work, after waiting for results of the GPU."""
    WHOLE = 2
    """All of the work, however long it takes."""

    @property
    def waits(self) -> bool:
        """True if the CPU waits for results of the GPU."""
        return self is not Budget.SHARE

    @property
    def is_whole(self) -> bool:
        """True if the frame must do all of the work."""
        return self is Budget.WHOLE


@dataclass(frozen=True)
class Step:
    """Budget and circumstances of one run of a pass that works in parts."""

    budget: Budget
    is_same_view: bool
    """True if the target holds an unfinished result of equal inputs."""
    is_stale: bool
    """True if an output that the pass reads has changed since the last run."""


@dataclass(frozen=True)
class Progress:
    """Result of one run of a pass."""

    has_changed: bool = True
    """True if the content of the target may have changed."""
    pending: tuple[Pending, ...] = ()


class RenderPass(Generic[Inputs, Target]):
    """Pass of a frame. It knows no other pass; its settings are given when it is made.

    Inputs are a frozen dataclass. Equal inputs, and equal versions of the outputs read, must give the same content. Fields that follow
    from the others are declared with `compare=False`. A pass overrides one of the methods.
    """

    name: str
    """Name of the pass in `FrameResult.timings_ms`."""

    def run(self, inputs: Inputs, target: Target, /) -> None:
        """Write all of `target`."""
        raise NotImplementedError

    def advance(self, inputs: Inputs, target: Target, _step: Step, /) -> Progress:
        """Do a frame's share of the work. Override it if the target takes several frames."""
        self.run(inputs, target)
        return Progress()

    def advance_all(self, parts: Sequence[tuple[Inputs, Target, Step]], /) -> Sequence[Progress]:
        """Do a frame's share of the work for each of these targets. Override it if one run draws several targets."""
        return [self.advance(*part) for part in parts]


@dataclass(frozen=True)
class PassTarget(Generic[Inputs, Target]):
    """Target, inputs and read outputs of a pass that draws several targets at once."""

    inputs: Inputs
    target: Target
    reads: Sequence[Output]
    owner: Hashable
    """Owner of the target's share of the time (`PassTimer.owned_by`)."""


@dataclass(frozen=True)
class _Record:
    """Inputs and versions from which the content of a target was made."""

    inputs: object
    reads: tuple[int, ...]
    """Versions of the outputs that were read."""
    version: int
    pending: tuple[Pending, ...] = ()
    """Parts that the pass itself has still to add."""


def largest_of_each(items: Iterable[Pending]) -> tuple[Pending, ...]:
    """Return for each part the item with most left."""
    largest = dict[Part, Pending]()
    for item in items:
        if item.part not in largest or item.left > largest[item.part].left:
            largest[item.part] = item
    return tuple(largest[part] for part in SENTENCES if part in largest)


class PassScheduler:
    """Scheduler that runs all passes. It records what each target was made from while the target exists."""

    def __init__(self, timer: PassTimer) -> None:
        self.timer = timer
        self._usual = Budget.ANSWERS if timer.waits else Budget.SHARE
        self.budget = self._usual
        self.skipped: Counter[str] = Counter()
        """Counts of skipped work since `take_skipped`, by name."""
        self.ran = 0
        """Number of runs of passes so far."""
        self._records: WeakKeyDictionary[object, _Record] = WeakKeyDictionary()
        self._versions = count(1)

    @contextmanager
    def drawing(self, whole: bool) -> Iterator[None]:
        """Do all pending work within the block if `whole`, else a frame's share."""
        before, self.budget = self.budget, Budget.WHOLE if whole else self._usual
        try:
            yield
        finally:
            self.budget = before

    def advance(
        self,
        render_pass: RenderPass[Inputs, Target],
        inputs: Inputs,
        target: Target,
        reads: Sequence[Output] = (),
        owner: Hashable = None,
        timing: Timing | None = None,
    ) -> Output:
        """Run the pass if `target` is out of date or incomplete; return the output of `target`.

        A complete target made from equal inputs and the same versions of `reads` stays. `timing` measures the time; None:
        `PassTimer.measure`.
        """
        before = self._take(inputs, target, reads)
        if isinstance(before, Output):
            return before
        step = self._step(before, inputs, reads)
        with (
            self.timer.owned_by(owner) if owner is not None else NOT_OWNED,
            (timing or self.timer.measure)(render_pass.name),
        ):
            done = render_pass.advance(inputs, target, step)
        return self._note(inputs, target, reads, before, step, done)

    def advance_all(
        self, render_pass: RenderPass[Inputs, Target], parts: Sequence[PassTarget[Inputs, Target]]
    ) -> list[Output]:
        """Do `advance` for several targets. The outdated ones are drawn in one run, and share its time."""
        taken_records = [self._take(part.inputs, part.target, part.reads) for part in parts]
        outputs = {
            part.owner: taken for part, taken in zip(parts, taken_records, strict=True) if isinstance(taken, Output)
        }
        stale = [
            (part, before, self._step(before, part.inputs, part.reads))
            for part, before in zip(parts, taken_records, strict=True)
            if not isinstance(before, Output)
        ]
        if stale:
            with self.timer.owned_by(*(part.owner for part, _, _ in stale)), self.timer.measure(render_pass.name):
                done = render_pass.advance_all([(part.inputs, part.target, step) for part, _, step in stale])
            for (part, before, step), progress in zip(stale, done, strict=True):
                outputs[part.owner] = self._note(part.inputs, part.target, part.reads, before, step, progress)
        return [outputs[part.owner] for part in parts]

    def _take(self, inputs: object, target: object, reads: Sequence[Output]) -> Output | _Record | None:
        """Return the output of an up-to-date `target`; else remove its record and return it."""
        record = self._records.get(target)
        if (
            record is not None
            and not record.pending
            and record.inputs == inputs
            and record.reads == _versions_of(reads)
        ):
            self.skipped["passes"] += 1
            return _output(record, reads)
        # The pass may raise an exception and leave the target half drawn, so the record is gone until the pass has run.
        self.invalidate(target)
        self.ran += 1
        return record

    def _step(self, before: _Record | None, inputs: object, reads: Sequence[Output]) -> Step:
        is_same = before is not None and before.inputs == inputs
        return Step(self.budget, is_same, before is not None and before.reads != _versions_of(reads))

    def _note(
        self,
        inputs: object,
        target: object,
        reads: Sequence[Output],
        before: _Record | None,
        step: Step,
        done: Progress,
    ) -> Output:
        stays = before is not None and step.is_same_view and not done.has_changed
        version = before.version if before is not None and stays else next(self._versions)
        record = self._records[target] = _Record(inputs, _versions_of(reads), version, done.pending)
        return _output(record, reads)

    def invalidate(self, target: object) -> None:
        """Make the next `advance` write `target` again."""
        self._records.pop(target, None)

    def forget(self) -> None:
        """Discard the times and counts since the last frame, so the next frame does not report them."""
        self.timer.forget()
        self.skipped.clear()

    def take_skipped(self) -> dict[str, int]:
        """Return the counts of skipped work since the last call, by name."""
        skipped, self.skipped = dict(self.skipped), Counter()
        return skipped


def _versions_of(reads: Sequence[Output]) -> tuple[int, ...]:
    return tuple(output.version for output in reads)


def _output(record: _Record, reads: Sequence[Output]) -> Output:
    return Output(record.version, record.pending + tuple(item for output in reads for item in output.pending))
