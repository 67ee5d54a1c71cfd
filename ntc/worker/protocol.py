"""The messages between the window and a worker process, and their bytes."""

from collections.abc import Callable

import msgspec

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
    """To the process: the last Part of a key was taken; the next one may be sent."""

    key: int | None


Command = Call | Pause | Resume | Cancel | Taken
"""What the window sends."""


class Received(msgspec.Struct, frozen=True, tag=True):
    """The process has copied the argument of a call. Not passed on."""


class Paused(msgspec.Struct, frozen=True, tag=True):
    """The call is paused, and takes no processor time."""


class Resumed(msgspec.Struct, frozen=True, tag=True):
    """The call continues after a pause."""


class Part(msgspec.Struct, frozen=True, tag=True):
    """Something that is known before the call has ended. The next one of the same key is sent once this one was taken."""

    key: int | None
    """Of a training: the group whose snapshot this is; None: progress."""
    value: Parcel


class Answer(msgspec.Struct, frozen=True, tag=True):
    """What a call returned."""

    value: Parcel


class Failed(msgspec.Struct, frozen=True, tag=True):
    """A call, or the whole process, failed; the process can be started again."""

    line: str
    """One line: what happened, and what to do about it."""
    details: str = ""
    """For a log."""


WorkerReport = Received | Paused | Resumed | Part | Answer | Failed
"""What the process sends."""


encode = msgspec.msgpack.encode
decode_command: Callable[[bytes], Command] = msgspec.msgpack.Decoder(Command).decode
decode_report: Callable[[bytes], WorkerReport] = msgspec.msgpack.Decoder(WorkerReport).decode
