"""The messages between the window and the training process, and their bytes. Needs no torch.

Messages are frozen dataclasses. As bytes they are msgpack, [name of the class, its fields], checked against the fields' types
when decoded; the name of what depends on the codec ends in the codec's: `StartTraining.block`. Not pickle, which
`Connection.send` would use: unpickling damaged bytes may call anything. Arrays are sent as places in shared memory
(`ntc.worker.shared_arrays`). File paths are sent as null: they mean nothing to the other process.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

import msgspec
import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.model import GridDecoder
from ntc.codec.model import Pack
from ntc.errors import WireError
from ntc.training.progress import Ended, EndReason, GroupOutcome, TrainingProgress
from ntc.training.request import TrainingRequest
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.shared_arrays import ArrayPlace, replaced


@dataclass(frozen=True, eq=False)
class StartTraining:
    """To the worker: start a training. Arrays of the request are places in the input block."""

    request: TrainingRequest
    input_block: str
    snapshot_block: str
    regions: Mapping[int, int]
    """By dirty group: first byte of its region in the snapshot block."""


@dataclass(frozen=True)
class Pause:
    """To the worker: stop at once, and wait."""


@dataclass(frozen=True)
class Resume:
    """To the worker: continue."""


@dataclass(frozen=True)
class Cancel:
    """To the worker: end the training; there is no result."""


@dataclass(frozen=True)
class SnapshotTaken:
    """To the worker: the region of a group may be written again."""

    group: int


@dataclass(frozen=True)
class ProgressTaken:
    """To the worker: the last progress report has been read."""


Command = StartTraining | Pause | Resume | Cancel | SnapshotTaken | ProgressTaken


@dataclass(frozen=True)
class Ready:
    """The worker process accepts commands. Not passed on to the window."""


@dataclass(frozen=True)
class Received:
    """The worker has opened its blocks and copied the request. Not passed on to the window."""


@dataclass(frozen=True)
class Paused:
    """Training is paused, and takes no processor time."""


@dataclass(frozen=True)
class Resumed:
    """Training continues after a pause."""


@dataclass(frozen=True, eq=False)
class Finished:
    """The training is over: what the window gets in place of `Ended`."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    pack: Pack | None = None
    """The trained pack; None when the training was cancelled."""


@dataclass(frozen=True)
class Failed:
    """The training, or its whole process, failed; the worker can be started again."""

    line: str
    """One line: what happened, and what to do about it."""
    details: str = ""
    """For a log."""


Report = Paused | Resumed | TrainingProgress | GroupSnapshot | Finished | Failed
"""What the window gets."""
WorkerReport = Ready | Received | Paused | Resumed | TrainingProgress | GroupSnapshot | Ended | Failed
"""What the worker sends. Arrays of snapshots are places in the snapshot block."""


def _encode_other(value: Any) -> Any:
    """What messages hold beside msgpack's types: paths, numpy's numbers and subclasses of str."""
    if isinstance(value, Path):
        return None
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, str):
        return str(value)
    raise TypeError(f"a {type(value).__name__} is not sent")


def _decode_other(kind: type, value: Any) -> Any:
    """A place where a dataclass has an array. It comes in an array of one object, for msgspec checks the field's type."""
    if kind is Path:
        raise ValueError("paths are not sent")
    boxed = np.empty((), object)
    boxed[()] = msgspec.convert(value, ArrayPlace)
    return boxed


# msgspec decodes no union of dataclasses, so what depends on the codec has a type for each codec.


@dataclass(frozen=True, eq=False)
class _GridPack(Pack):
    config: GridConfig
    decoders: tuple[GridDecoder, ...]


@dataclass(frozen=True, eq=False)
class _GridRequest(TrainingRequest):
    codec: GridConfig
    start: _GridPack | None = None


@dataclass(frozen=True, eq=False)
class _GridStart(StartTraining):
    request: _GridRequest


@dataclass(frozen=True, eq=False)
class _GridSnapshot(GroupSnapshot):
    decoder: GridDecoder


@dataclass(frozen=True, eq=False)
class _BlockPack(Pack):
    config: BlockConfig
    decoders: tuple[BlockDecoder, ...]


@dataclass(frozen=True, eq=False)
class _BlockRequest(TrainingRequest):
    codec: BlockConfig
    start: _BlockPack | None = None


@dataclass(frozen=True, eq=False)
class _BlockStart(StartTraining):
    request: _BlockRequest


@dataclass(frozen=True, eq=False)
class _BlockSnapshot(GroupSnapshot):
    decoder: BlockDecoder


_BY_CODEC: Mapping[type[Any], Mapping[str, type[Any]]] = {
    StartTraining: {GridConfig.kind: _GridStart, BlockConfig.kind: _BlockStart},
    GroupSnapshot: {GridConfig.kind: _GridSnapshot, BlockConfig.kind: _BlockSnapshot},
}


def _name(message: Command | WorkerReport) -> str:
    if isinstance(message, StartTraining):
        return f"{StartTraining.__name__}.{message.request.codec.kind}"
    if isinstance(message, GroupSnapshot):
        codec = BlockConfig if isinstance(message.decoder, BlockDecoder) else GridConfig
        return f"{GroupSnapshot.__name__}.{codec.kind}"
    return type(message).__name__


def _decoders(messages: Any) -> dict[str, msgspec.msgpack.Decoder[Any]]:
    decoded: dict[str, type] = {}
    for kind in get_args(messages):
        by_codec = _BY_CODEC.get(kind)
        names = {kind.__name__: kind} if by_codec is None else {f"{kind.__name__}.{c}": t for c, t in by_codec.items()}
        decoded.update(names)
    return {name: msgspec.msgpack.Decoder(kind, dec_hook=_decode_other) for name, kind in decoded.items()}


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encode_other)
_NAMED = msgspec.msgpack.Decoder(tuple[str, msgspec.Raw])
_COMMANDS, _REPORTS = _decoders(Command), _decoders(WorkerReport)


def encode(message: Command | WorkerReport) -> bytes:
    """The bytes of a message whose arrays are places. Raises WireError for values that cannot be encoded: halves of surrogate
    pairs, integers of more than 64 bits, records that are not JSON."""
    name = _name(message)
    try:
        return _ENCODER.encode((name, message))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise WireError(f"{name} cannot be sent: {error}") from error


def _widened(message: Any) -> Any:
    """A message of the type that is known outside, instead of that for one codec."""
    for kind in _BY_CODEC:
        if isinstance(message, kind):
            return kind(**{field.name: getattr(message, field.name) for field in dataclasses.fields(message)})
    return message


def _decode(decoders: Mapping[str, msgspec.msgpack.Decoder[Any]], data: bytes) -> Any:
    try:
        name, fields = _NAMED.decode(data)
        if name not in decoders:
            raise ValueError(f"unknown message {name[:60]!r}")
        return _widened(replaced(decoders[name].decode(fields), np.ndarray, lambda boxed: boxed.item()))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        # msgspec's own errors are ValueErrors, and so is what is not UTF-8.
        raise WireError(" ".join(str(error).split())[:200]) from error


def decode_command(data: bytes) -> Command:
    """What the window sent. Raises WireError for anything else."""
    return cast(Command, _decode(_COMMANDS, data))


def decode_report(data: bytes) -> WorkerReport:
    """What the training process sent. Raises WireError for anything else."""
    return cast(WorkerReport, _decode(_REPORTS, data))
