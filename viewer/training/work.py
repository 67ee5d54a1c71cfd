"""The run of a training that is under way, and what was shown before it."""

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from ntc.pack.model import Pack
from ntc.training.snapshot import ended_pack
from ntc.worker.protocol import TrainingRequest, WorkerProgress
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE, CompareMode, Slot
from viewer.training.preparation import Wish
from viewer.training.runs import Curves, run_name

if TYPE_CHECKING:
    from viewer.state.session import Session

State = Literal["idle", "preparing", "training", "pausing", "paused", "cancelling"]


@dataclass(frozen=True)
class Before:
    """What was shown before a run."""

    slot_a: Slot
    slot_b: Slot
    compare: CompareMode


@dataclass
class Work:
    """The run under way."""

    number: int
    wish: Wish
    scene: Scene
    base_name: str | None
    """The pack that it goes on from."""
    base: Pack | None
    began: float
    """Monotonic seconds."""
    state: State = "preparing"
    request: TrainingRequest | None = None
    pack: Pack | None = None
    """What the snapshots so far make."""
    groups_seen: frozenset[int] = frozenset()
    """Groups of which a snapshot has come."""
    progress: WorkerProgress | None = None
    first_picture_seconds: float | None = None
    """From the wish to the first snapshot."""
    curves: Curves = field(default_factory=Curves)
    notes: tuple[str, ...] = ()
    before: "Before | None" = None
    """What was shown when the first snapshot came."""
    is_ahead: bool = False
    """Whether `pack` is newer than what is shown of it."""
    put_up_at: float = -math.inf
    """When it was shown last, monotonic seconds."""

    @property
    def name(self) -> str:
        """As which its pack is open."""
        return run_name(self.number)

    def pack_so_far(self) -> Pack | None:
        """What snapshots have made, if every group that was to be trained has had one."""
        request, pack = self.request, self.pack
        if request is None or pack is None or not self.groups_seen >= (request.dirty or frozenset()):
            return None
        whole = ended_pack(pack, request.grouping)
        return replace(whole, training={**whole.training, "ended_early": True})

    def show_beside(self, session: "Session") -> None:
        """Slot A shows the pack that changes, B what it was or should become."""
        view = session.view
        self.before = Before(view.slot_a, view.slot_b, view.compare)
        path = "cached" if view.slot_a.source == REFERENCE else view.slot_a.path
        slot_b = view.slot_b
        if self.base_name is not None and self.base_name in session.packs:
            # Without another decode of the same: B is as A was.
            slot_b = replace(view.slot_a, source=self.base_name)
        compare = "wipe" if view.slot_a.source == REFERENCE and view.slot_b.source == REFERENCE else view.compare
        slot_a = replace(view.slot_a, source=self.name, path=path)
        session.view = replace(view, slot_a=slot_a, slot_b=slot_b, compare=compare)


def put_away(session: "Session", name: str, before: Before | None) -> None:
    """Close the pack `name`; where A shows it, show what was there before."""
    packs = {other: pack for other, pack in session.packs.items() if other != name}
    view = session.view
    if view.slot_a.source == name and before is not None:
        view = replace(view, slot_a=before.slot_a, slot_b=before.slot_b, compare=before.compare)
    gone = {slot.source for slot in (view.slot_a, view.slot_b)} - {REFERENCE, *packs}
    a, b = (replace(slot, source=REFERENCE) if slot.source in gone else slot for slot in (view.slot_a, view.slot_b))
    session.view = replace(view, slot_a=a, slot_b=b)
    session.packs = packs
