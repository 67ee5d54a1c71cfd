"""The pipe between the window and the training process: a pair of sockets, and messages preceded by their length.

`multiprocessing.Pipe` does not fit: `poll` returns True once a message has begun, and `recv` then blocks until it is complete.
A process that is stopped in the middle of a message, or does not read, would block the window.
"""

import socket
import struct
from collections import deque

from ntc.errors import WireError

_LENGTH = struct.Struct("<I")
CHUNK = 1 << 16
"""Bytes read at once: memory grows with the bytes received, not with the length that a message claims."""
MOST_UNSENT = 1000
"""Commands that may wait to be sent; a process that reads them leaves a few at most."""
LONGEST_COMMAND = 1 << 28
"""Bytes. A request takes about 1 KB for each texture: pixels are in shared memory."""


def framed(message: bytes) -> bytes:
    """A message with its length before it. Raises WireError for one of more than LONGEST_COMMAND bytes."""
    if len(message) > LONGEST_COMMAND:
        raise WireError(f"a message of {len(message) / 1e6:.0f} MB cannot be sent")
    return _LENGTH.pack(len(message)) + message


class _Incoming:
    """Splits received bytes into messages."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def take(self, longest: int) -> bytes | None:
        """The next message; None until it is complete. Raises WireError for one of more than `longest` bytes."""
        if len(self._bytes) < _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack_from(self._bytes)
        if length > longest:
            raise WireError(f"a message of {length} bytes; at most {longest} are accepted")
        end = _LENGTH.size + length
        if len(self._bytes) < end:
            return None
        message = bytes(self._bytes[_LENGTH.size : end])
        del self._bytes[:end]
        return message

    def add(self, data: bytes) -> None:
        """Append received bytes. Raises EOFError for none: the other end is closed."""
        if not data:
            raise EOFError
        self._bytes += data


class WindowEnd:
    """The window's end, which never blocks."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._incoming = _Incoming()
        self._unsent: deque[memoryview] = deque()

    def receive(self, longest: int) -> bytes | None:
        """The next message; None until it is complete. Raises EOFError or OSError when the other end is gone, and WireError
        for a message of more than `longest` bytes and for a process that does not read its commands."""
        if len(self._unsent) > MOST_UNSENT:
            raise WireError("it does not read its commands")
        while (message := self._incoming.take(longest)) is None:
            try:
                self._incoming.add(self._end.recv(CHUNK))
            except BlockingIOError:
                return None
        return message

    def send(self, message: bytes) -> None:
        """Send a framed message, or as much of it as fits; `flush` sends the rest. `receive` reports a closed pipe."""
        self._unsent.append(memoryview(message))
        self.flush()

    def flush(self) -> None:
        """Send the rest of earlier messages, as far as it fits."""
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
        """Close the socket."""
        self._end.close()


class WorkerEnd:
    """The training process's end, which blocks: one thread may receive while another one sends."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._incoming = _Incoming()

    def receive(self) -> bytes:
        """The next message. Raises EOFError or OSError when the window is gone, WireError for a message that is too long."""
        while (message := self._incoming.take(LONGEST_COMMAND)) is None:
            self._incoming.add(self._end.recv(CHUNK))
        return message

    def send(self, message: bytes) -> None:
        """Send a message. Raises OSError when the window is gone."""
        self._end.sendall(framed(message))
