"""The messages between the window and a worker process, and their bytes. Needs no torch."""

from dataclasses import dataclass
from typing import Any

import msgspec

from ntc.codec.model import Pack
from ntc.training.progress import EndReason, GroupOutcome, TrainingProgress
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.shared_arrays import Parcel


class Call(msgspec.Struct, frozen=True, tag=True):
    """To the process: call its function, after the calls before."""

    argument: Parcel


class Pause(msgspec.Struct, frozen=True, tag=True):
    """To the process: stop at once, and wait."""


class Resume(msgspec.Struct, frozen=True, tag=True):
    """To the process: continue."""


class Cancel(msgspec.Struct, frozen=True, tag=True):
    """To the process: end the call; it has no result."""


class Taken(msgspec.Struct, frozen=True, tag=True):
    """To the process: the last snapshot of a group, or the last progress, was taken; the next one may be sent."""

    group: int | None = None
    """None: progress."""


Command = Call | Pause | Resume | Cancel | Taken
"""What the window sends."""


class Received(msgspec.Struct, frozen=True, tag=True):
    """The process has copied the argument of a call. Not passed on."""


class Paused(msgspec.Struct, frozen=True, tag=True):
    """Training is paused, and takes no processor time."""


class Resumed(msgspec.Struct, frozen=True, tag=True):
    """Training continues after a pause."""


class Progress(msgspec.Struct, frozen=True, tag=True):
    """How far a training is."""

    progress: TrainingProgress


class Snapshot(msgspec.Struct, frozen=True, tag=True):
    """A GroupSnapshot, whose large arrays lie in the region of its group."""

    snapshot: Parcel


class Answer(msgspec.Struct, frozen=True, tag=True):
    """What a call returned."""

    value: Parcel


class Failed(msgspec.Struct, frozen=True, tag=True):
    """A call, or the whole process, failed; the process can be started again."""

    line: str
    """One line: what happened, and what to do about it."""
    details: str = ""
    """For a log."""


WorkerReport = Received | Paused | Resumed | Progress | Snapshot | Answer | Failed
"""What the process sends."""


@dataclass(frozen=True, eq=False)
class Finished:
    """The end of a training, as the window gets it."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    pack: Pack | None = None
    """The trained pack; None when the training was cancelled."""


Report = Paused | Resumed | TrainingProgress | GroupSnapshot | Finished | Failed
"""What the window gets of a training."""


def _plain_number(value: Any) -> Any:
    """A number of numpy as one of Python."""
    return value.item()


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_plain_number)
_COMMANDS: msgspec.msgpack.Decoder[Command] = msgspec.msgpack.Decoder(Command)
_REPORTS: msgspec.msgpack.Decoder[WorkerReport] = msgspec.msgpack.Decoder(WorkerReport)
encode = _ENCODER.encode
decode_command = _COMMANDS.decode
decode_report = _REPORTS.decode
