"""The training run under way."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from ntc.codec.model import Pack
from ntc.training.progress import TrainingProgress
from ntc.training.request import TrainingRequest
from ntc.training.snapshot import GroupSnapshot, apply_snapshot, ended_pack
from viewer.scene.model import Scene
from viewer.training.preparation import TrainingJob, job_title, settings_text
from viewer.training.run_log import Curves, Run, mean_of_psnr

State = Literal["idle", "preparing", "training", "pausing", "paused", "cancelling"]
MOST_NOTES = 20


@dataclass
class ActiveRun:
    """A training run from the request of the user to its end."""

    number: int
    job: TrainingJob
    scene: Scene
    base_name: str | None
    """Name of the open pack that it goes on from; None for an encoding from nothing."""
    began: float
    """Monotonic seconds."""
    state: State = "preparing"
    request: TrainingRequest | None = None
    """None while it is prepared."""
    pack: Pack | None = None
    """The pack that it started from, with the snapshots so far."""
    groups_seen: frozenset[int] = frozenset()
    """Groups of which a snapshot has come."""
    progress: TrainingProgress | None = None
    first_picture_seconds: float | None = None
    """From the request to the first snapshot."""
    curves: Curves = field(default_factory=Curves)
    notes: tuple[str, ...] = ()
    published: Pack | None = None
    """`pack` as it was published last."""
    published_at: float = -math.inf
    """Monotonic seconds."""
    kept: Pack | None = None
    """`pack` as it was kept in the data folder last."""
    kept_at: float = -math.inf
    """Monotonic seconds."""

    @property
    def codec_kind(self) -> str | None:
        """Codec of the pack that it makes; None while it is prepared."""
        return None if self.request is None else self.request.codec.kind

    @property
    def name(self) -> str:
        """Name under which its pack is open."""
        return f"run {self.number}"

    def add_progress(self, progress: TrainingProgress) -> None:
        """Take in a report of the worker."""
        self.progress = progress
        self.curves.add(progress)
        if progress.note:
            self.notes = (*self.notes, progress.note)[-MOST_NOTES:]

    def add_snapshot(self, snapshot: GroupSnapshot) -> None:
        """Take in a trained group."""
        assert self.pack is not None
        self.pack = apply_snapshot(self.pack, snapshot)
        self.groups_seen |= {snapshot.group}

    def pack_so_far(self) -> Pack | None:
        """The pack of the snapshots, if every group that was to be trained has had one."""
        request, pack = self.request, self.pack
        if request is None or pack is None or not self.groups_seen >= (request.dirty or frozenset()):
            return None
        whole = ended_pack(pack, request.grouping)
        return replace(whole, training={**whole.training, "ended_early": True})

    def ended(self, outcome: str, pack: Pack | None, lines: tuple[str, ...]) -> Run:
        """The run as the log keeps it; `pack` is what it made, `lines` say what became of each group."""
        progress = self.progress
        textures = pack.textures if pack is not None else ()
        known = [texture.psnr_db for texture in textures if texture.psnr_db is not None]
        if len(known) < len(textures):
            known = list(progress.psnr_db.values()) if progress is not None else []
        return Run(
            self.number,
            job_title(self.job),
            settings_text(self.job),
            self.request.grouping.group_count if self.request is not None else 0,
            outcome,
            progress.elapsed_seconds if progress is not None else 0.0,
            mean_of_psnr(known) if known else None,
            (*lines, *self.notes),
            pack,
        )
