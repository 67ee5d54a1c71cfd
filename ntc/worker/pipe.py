"""The pipe between the window and the training process: a pair of sockets, and messages with their length before them.

`multiprocessing.Pipe` would do but for one thing: its `poll` says that a message has begun, and `recv` then waits for the
rest. A process that is stopped in the middle of a message, or does not read, would hold up the window.
"""

import socket
import struct
from collections import deque

from ntc.errors import WireError

_LENGTH = struct.Struct("<I")
CHUNK = 1 << 16
"""Bytes read at once: memory grows with what has come, not with what a length claims."""
MOST_UNSENT = 1000
"""Commands that wait for a process which does not read them; it never leaves more than a few."""
LONGEST_COMMAND = 1 << 28
"""Bytes. A request takes about 1 KB for each texture: pixels are in shared memory."""


def framed(message: bytes) -> bytes:
    """A message as it goes through the pipe. Raises WireError for one that nobody would take."""
    if len(message) > LONGEST_COMMAND:
        raise WireError(f"a message of {len(message) / 1e6:.0f} MB cannot be sent")
    return _LENGTH.pack(len(message)) + message


class _Incoming:
    """Bytes as they come, cut into messages."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def take(self, longest: int) -> bytes | None:
        """The next message; None as long as it is not whole. Raises WireError for one of more than `longest` bytes."""
        if len(self._bytes) < _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack_from(self._bytes)
        if length > longest:
            raise WireError(f"a message of {length} bytes, where at most {longest} are possible")
        end = _LENGTH.size + length
        if len(self._bytes) < end:
            return None
        message = bytes(self._bytes[_LENGTH.size : end])
        del self._bytes[:end]
        return message

    def add(self, data: bytes) -> None:
        """More bytes. Raises EOFError where there are none: the other end is closed."""
        if not data:
            raise EOFError
        self._bytes += data


class WindowEnd:
    """The window's end, which never waits."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._incoming = _Incoming()
        self._unsent: deque[memoryview] = deque()

    def receive(self, longest: int) -> bytes | None:
        """The next message; None as long as it is not here. Raises EOFError or OSError when the other end is gone, and
        WireError for a message of more than `longest` bytes and for a process that does not read."""
        if len(self._unsent) > MOST_UNSENT:
            raise WireError("it does not listen")
        while (message := self._incoming.take(longest)) is None:
            try:
                self._incoming.add(self._end.recv(CHUNK))
            except BlockingIOError:
                return None
        return message

    def send(self, message: bytes) -> None:
        """Send a framed message, or as much of it as fits; `flush` sends the rest. That nobody is there, `receive` says."""
        self._unsent.append(memoryview(message))
        self.flush()

    def flush(self) -> None:
        """Send what is left of earlier messages, as far as it fits."""
        try:
            while self._unsent:
                sent = self._end.send(self._unsent[0])
                self._unsent[0] = self._unsent[0][sent:]
                if not self._unsent[0]:
                    self._unsent.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self._unsent.clear()

    def close(self) -> None:
        """Give the socket back."""
        self._end.close()


class WorkerEnd:
    """The training process's end, which waits: one thread may receive and another one send."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._incoming = _Incoming()

    def receive(self) -> bytes:
        """The next message. Raises EOFError or OSError when the window is gone, WireError for what is too long."""
        while (message := self._incoming.take(LONGEST_COMMAND)) is None:
            self._incoming.add(self._end.recv(CHUNK))
        return message

    def send(self, message: bytes) -> None:
        """Send a message. Raises OSError when the window is gone."""
        self._end.sendall(framed(message))
