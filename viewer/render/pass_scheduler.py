"""The scheduler of a frame: it runs the passes that have something to do, times them, and counts what it skipped."""

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
"""Function that takes the time of a block under a name."""
Part = Literal["textures", "images", "tiles", "loads", "samples", "packs", "statistics", "environment"]
NOT_OWNED = nullcontext()
"""Context of a pass whose time counts for no slot or plane alone."""
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
    pending: tuple[Pending, ...] = ()
    """Parts that later frames add; empty where the content is complete."""

    @property
    def is_complete(self) -> bool:
        """True where running the passes again would change nothing."""
        return not self.pending


class Budget(IntEnum):
    """How far a frame takes passes that work in parts."""

    SHARE = 0
    """A frame's share of the work; what the GPU answers late counts in a later frame."""
    ANSWERS = 1
    """A frame's share of the work, after waiting for the answers of the GPU."""
    WHOLE = 2
    """All of the work: nothing is left for later frames, however long it takes."""

    @property
    def waits(self) -> bool:
        """True where the CPU waits for the answers of the GPU."""
        return self is not Budget.SHARE

    @property
    def is_whole(self) -> bool:
        """True where nothing may be left for later frames."""
        return self is Budget.WHOLE


@dataclass(frozen=True)
class Step:
    """Circumstances of one run of a pass that works in parts."""

    budget: Budget
    is_same_view: bool
    """True where the target shows an earlier state of equal inputs."""
    is_stale: bool
    """True where an output that the pass reads has another version than at the last run."""


@dataclass(frozen=True)
class Progress:
    """Result of one run of a pass."""

    has_changed: bool = True
    """True where the target may show something else than before."""
    pending: tuple[Pending, ...] = ()


class RenderPass(Generic[Inputs, Target]):
    """Pass of a frame. It knows no other pass; its settings are given when it is made.

    Inputs are a frozen dataclass: equal inputs, and equal versions of what is read, give the same content of the same target. Fields
    that follow from the others do not take part in the comparison. A pass overrides one of its methods.
    """

    name: str
    """Name of its time in `FrameResult.timings_ms`."""

    def run(self, inputs: Inputs, target: Target, /) -> None:
        """Write all of `target`."""
        raise NotImplementedError

    def advance(self, inputs: Inputs, target: Target, _step: Step, /) -> Progress:
        """Do a frame's share of the work, where the target becomes complete over several frames."""
        self.run(inputs, target)
        return Progress()

    def advance_all(self, parts: Sequence[tuple[Inputs, Target, Step]], /) -> Sequence[Progress]:
        """Do a frame's share of the work for each of these targets, where several are drawn at once."""
        return [self.advance(*part) for part in parts]


@dataclass(frozen=True)
class PassTarget(Generic[Inputs, Target]):
    """One of the targets that a pass draws at once."""

    inputs: Inputs
    target: Target
    reads: Sequence[Output]
    owner: Hashable
    """Owner of its share of the time (`PassTimer.owned_by`)."""


@dataclass(frozen=True)
class _Record:
    """Inputs and versions from which the content of a target was made."""

    inputs: object
    reads: tuple[int, ...]
    """Versions of the outputs that were read."""
    version: int
    pending: tuple[Pending, ...] = ()
    """Parts that the pass itself still adds."""


def largest_of_each(items: Iterable[Pending]) -> tuple[Pending, ...]:
    """Return one item for each part: the one with most left."""
    found = dict[Part, Pending]()
    for item in items:
        if item.part not in found or item.left > found[item.part].left:
            found[item.part] = item
    return tuple(found[part] for part in SENTENCES if part in found)


class PassScheduler:
    """Scheduler that runs all passes. It remembers what each target was made from, for as long as the target exists."""

    def __init__(self, timer: PassTimer) -> None:
        self.timer = timer
        self._usual = Budget.ANSWERS if timer.waits else Budget.SHARE
        self.budget = self._usual
        self.skipped: Counter[str] = Counter()
        """Numbers of what was skipped since `take_skipped`, by name."""
        self.ran = 0
        """Number of runs of passes so far."""
        self._records: WeakKeyDictionary[object, _Record] = WeakKeyDictionary()
        self._versions = count(1)

    @contextmanager
    def drawing(self, whole: bool) -> Iterator[None]:
        """Leave nothing for later frames within the block, if `whole`."""
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
        """Run the pass until `target` is complete, a step in each frame; return what `target` holds.

        A target that was made from equal inputs and the same versions of `reads` stays. `timing`: how the time is taken; None:
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
        self, render_pass: RenderPass[Inputs, Target], wanted: Sequence[PassTarget[Inputs, Target]]
    ) -> list[Output]:
        """Do `advance` for several targets: those that have something to do are drawn at once, and share the time."""
        found = [self._take(part.inputs, part.target, part.reads) for part in wanted]
        outputs = {part.owner: taken for part, taken in zip(wanted, found, strict=True) if isinstance(taken, Output)}
        stale = [
            (part, before, self._step(before, part.inputs, part.reads))
            for part, before in zip(wanted, found, strict=True)
            if not isinstance(before, Output)
        ]
        if stale:
            with self.timer.owned_by(*(part.owner for part, _, _ in stale)), self.timer.measure(render_pass.name):
                done = render_pass.advance_all([(part.inputs, part.target, step) for part, _, step in stale])
            for (part, before, step), progress in zip(stale, done, strict=True):
                outputs[part.owner] = self._note(part.inputs, part.target, part.reads, before, step, progress)
        return [outputs[part.owner] for part in wanted]

    def _take(self, inputs: object, target: object, reads: Sequence[Output]) -> Output | _Record | None:
        """Return the output where nothing is to be done; else the record of `target`, which is forgotten until the pass has run."""
        record = self._records.get(target)
        if (
            record is not None
            and not record.pending
            and record.inputs == inputs
            and record.reads == _versions_of(reads)
        ):
            self.skipped["passes"] += 1
            return _output(record, reads)
        # The pass may raise.
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
        """Forget the content of `target`: it is made again."""
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
    return Output(record.version, record.pending + tuple(item for output in reads for item in output.pending))
