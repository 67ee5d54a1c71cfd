"""How messages between the window and the training process lie in bytes: msgpack that is checked type by type when read.

Not pickle, which `Connection.send` would use: unpickling bytes that a memory fault has touched may call anything. The
messages stay dataclasses; of each a msgspec struct is derived, with the name of the class as its tag, so that a message
of another kind, an unknown or missing field or a value of another type is refused. Arrays are places
(`ntc.worker.shared_arrays`), and files are not named: their names mean nothing to the other side.
"""

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Union, cast, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from ntc.worker.protocol import Command, WorkerReport
from ntc.worker.shared_arrays import ArrayPlace


class WireError(ValueError):
    """Bytes that are no message, or a message that has no bytes."""


@cache
def _struct(kind: type) -> type[msgspec.Struct]:
    """The struct of a dataclass; all fields are required."""
    hints = get_type_hints(kind)
    own = [(field.name, _wire_type(hints[field.name])) for field in fields(kind)]
    return msgspec.defstruct(
        kind.__name__, own, tag=kind.__name__, tag_field="is", forbid_unknown_fields=True, namespace={"kind": kind}
    )


def _wire_type(hint: Any) -> Any:
    origin, parts = get_origin(hint), get_args(hint)
    if origin is np.ndarray:
        # As it is: places are most of a message, and none of them needs a tag.
        return ArrayPlace
    if hint is Path:
        return None
    if is_dataclass(hint):
        return _struct(cast(type, hint))
    if origin in (Union, types.UnionType):
        return Union[tuple(_wire_type(part) for part in parts)]  # noqa: UP007 - of as many types as there are
    if origin is tuple:
        return tuple[tuple(part if part is Ellipsis else _wire_type(part) for part in parts)]  # type: ignore[misc]
    if origin is Mapping:
        return dict[tuple(_wire_type(part) for part in parts)]  # type: ignore[misc]
    return hint


def _plain(value: Any) -> Any:
    """Structs in place of the dataclasses in a value."""
    if isinstance(value, ArrayPlace):
        return value
    if is_dataclass(value) and not isinstance(value, type):
        return _struct(type(value))(**{field.name: _plain(getattr(value, field.name)) for field in fields(value)})
    if isinstance(value, tuple):
        return tuple(_plain(part) for part in value)
    if isinstance(value, Path):
        return None
    return value


def _message(value: Any) -> Any:
    """Dataclasses in place of the structs in a value. Raises ValueError for a value that a dataclass refuses."""
    if isinstance(value, msgspec.Struct):
        own = {name: _message(getattr(value, name)) for name in value.__struct_fields__}
        return value.kind(**own)  # type: ignore[attr-defined]
    if isinstance(value, tuple):
        return tuple(_message(part) for part in value)
    return value


def _other(value: Any) -> Any:
    """What records hold beside JSON values: numbers of numpy, and texts with a class of their own."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, str):
        return str(value)
    raise TypeError(f"a {type(value).__name__} is not sent")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_other)
_COMMANDS = msgspec.msgpack.Decoder(_wire_type(Command))
_REPORTS = msgspec.msgpack.Decoder(_wire_type(WorkerReport))


def encode(message: Command | WorkerReport) -> bytes:
    """The bytes of a message whose arrays are places. Raises WireError for values that have none: halves of surrogate
    pairs, integers of more than 64 bits, records that are no JSON."""
    try:
        return _ENCODER.encode(_plain(message))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise WireError(f"{type(message).__name__} cannot be sent: {error}") from error


def _decode(decoder: msgspec.msgpack.Decoder[Any], data: bytes) -> Any:
    try:
        return _message(decoder.decode(data))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        # msgspec's own errors are ValueErrors, and so is what is not UTF-8.
        raise WireError(" ".join(str(error).split())[:200]) from error


def decode_command(data: bytes) -> Command:
    """What the window sent. Raises WireError for anything else."""
    return cast(Command, _decode(_COMMANDS, data))


def decode_report(data: bytes) -> WorkerReport:
    """What the training process sent. Raises WireError for anything else."""
    return cast(WorkerReport, _decode(_REPORTS, data))
