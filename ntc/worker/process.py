"""The one kind of process beside the window, and its messages: it calls one function again and again, and takes commands meanwhile."""

import multiprocessing
import os
import queue
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import msgspec

from ntc.errors import InputError, ProcessEndedError
from ntc.worker.shared_arrays import Payload, SharedBlock, inside, received, sent

SECONDS_TO_END = 0.5
"""Longest wait for a process that was killed."""
LONGEST_DETAILS = 8000
"""Largest part of a traceback that is reported, in characters: its end holds the error."""


class Call(msgspec.Struct, frozen=True, tag=True):
    """Command to the process: call its function, after the calls before."""

    argument: Payload


class Pause(msgspec.Struct, frozen=True, tag=True):
    """Command to the process: stop at once, and wait."""


class Resume(msgspec.Struct, frozen=True, tag=True):
    """Command to the process: continue."""


class Cancel(msgspec.Struct, frozen=True, tag=True):
    """Command to the process: end the call; it has no result."""


class Taken(msgspec.Struct, frozen=True, tag=True):
    """Command to the process: the last Part of a key was taken; the next one may be sent."""

    key: int | None


Command = Call | Pause | Resume | Cancel | Taken
"""Commands that the window sends."""


class Received(msgspec.Struct, frozen=True, tag=True):
    """The process has copied the argument of a call. Not passed on."""


class Paused(msgspec.Struct, frozen=True, tag=True):
    """The call is paused, and takes no processor time."""


class Resumed(msgspec.Struct, frozen=True, tag=True):
    """The call continues after a pause."""


class Part(msgspec.Struct, frozen=True, tag=True):
    """A result that is known before the call has ended. The next one of the same key is sent once this one was taken."""

    key: int | None
    """Group whose snapshot this is, in a training. None: progress."""
    value: Payload


class Answer(msgspec.Struct, frozen=True, tag=True):
    """The return value of a call."""

    value: Payload


class Failed(msgspec.Struct, frozen=True, tag=True):
    """A call, or the whole process, failed; the process can be started again."""

    line: str
    """One line: what happened, and what to do about it."""
    details: str = ""
    """Traceback for a log."""


WorkerReport = Received | Paused | Resumed | Part | Answer | Failed
"""Reports that the process sends."""


encode = msgspec.msgpack.encode
decode_command: Callable[[bytes], Command] = msgspec.msgpack.Decoder(Command).decode
decode_report: Callable[[bytes], WorkerReport] = msgspec.msgpack.Decoder(WorkerReport).decode


class WindowEnd:
    """The window as the process sees it: commands so far, and reports to it. A thread listens, so that commands arrive during
    work; the process ends when the window closes its end, however the window's process ends."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._sending = threading.Lock()
        self.calls: queue.SimpleQueue[Call] = queue.SimpleQueue()
        self._changed = threading.Condition()
        self._paused = self._cancelled = False
        self._untaken: set[int | None] = set()
        """Keys whose last Part was not yet taken."""

    def listen(self) -> None:
        """Take commands until the window is gone, and end the process, which may be anywhere in its work."""
        try:
            while True:
                self._apply(decode_command(self._connection.recv_bytes()))
        finally:
            os._exit(0)

    def _apply(self, command: Command) -> None:
        with self._changed:
            match command:
                case Call():
                    self._paused = self._cancelled = False
                    self._untaken.clear()
                    self.calls.put(command)
                case Pause() | Resume():
                    self._paused = isinstance(command, Pause)
                case Cancel():
                    self._cancelled = True
                case Taken():
                    self._untaken.discard(command.key)
            self._changed.notify_all()

    @property
    def paused(self) -> bool:
        """True if the call is to pause."""
        return self._paused and not self._cancelled

    @property
    def cancelled(self) -> bool:
        """True if the call is to end."""
        return self._cancelled

    def wait(self, waits: Callable[[], bool]) -> None:
        """Wait while `waits` returns True and the call is not cancelled."""
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or not waits())

    def is_untaken(self, key: int | None) -> bool:
        """Return whether the last Part of a key was not yet taken."""
        return key in self._untaken

    def send(self, report: WorkerReport) -> None:
        """Send a report, from any thread. The process ends where the window is gone."""
        try:
            with self._sending:
                self._connection.send_bytes(encode(report))
        except OSError:
            os._exit(0)

    def send_part(self, key: int | None, value: Payload) -> None:
        """Send a Part; its key `is_untaken` until the window has taken it."""
        with self._changed:
            self._untaken.add(key)
        self.send(Part(key, value))


Function = Callable[[Any, WindowEnd], object]
"""Function that a process calls: (argument, window) -> answer. An exception is reported."""


def lower_priority(niceness: int) -> None:
    """Lower this process's priority to `niceness`, where the system has one."""
    if hasattr(os, "nice"):
        os.nice(max(0, niceness - os.nice(0)))


def _called(function: Function, call: Call, window: WindowEnd) -> Answer | Failed:
    try:
        try:
            argument = received(call.argument)
        finally:
            window.send(Received())
        return Answer(inside(function(argument, window)))
    except Exception as error:  # noqa: BLE001  Whatever fails is reported; the process stays for the next call.
        line = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        details = traceback.format_exc()[-LONGEST_DETAILS:]
        # File names may hold what is not Unicode.
        return Failed(str(InputError(line)), details.encode("utf-8", "backslashreplace").decode())


def serve(connection: Connection, function: Function, niceness: int) -> None:
    """The main function of the process."""
    # Ctrl-C in a terminal reaches this process too; the window decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority(niceness)
    window = WindowEnd(connection)
    threading.Thread(target=window.listen, daemon=True).start()
    while True:
        window.send(_called(function, window.calls.get(), window))


def _read(connection: Connection, inbox: "queue.SimpleQueue[WorkerReport | None]") -> None:
    try:
        with suppress(EOFError, OSError):
            while True:
                inbox.put(decode_report(connection.recv_bytes()))
    finally:
        inbox.put(None)


def _write(connection: Connection, outbox: "queue.SimpleQueue[bytes | None]") -> None:
    with suppress(OSError):
        while (message := outbox.get()) is not None:
            connection.send_bytes(message)


class WorkerProcess:
    """A spawned process that calls `function` for each `call`, until `end`. It ends with this one, however this one ends.

    Two threads read and write the pipe, so that no call waits for it, and a process that was stopped holds up nobody.
    `concurrent.futures.ProcessPoolExecutor` does not fit: its workers cannot be ended in the middle of a call, and outlive a
    parent that was killed.
    """

    def __init__(self, function: Function, name: str, niceness: int = 0) -> None:
        """Start it. `function` is found by its module and name. Raises OSError where no process can be started."""
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        arguments = (there, function, niceness)
        self._process = context.Process(target=serve, args=arguments, name=name, daemon=True)
        self._inbox: queue.SimpleQueue[WorkerReport | None] = queue.SimpleQueue()
        """None: the pipe is closed."""
        self._outbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._given: deque[SharedBlock | None] = deque()
        """Blocks of the arguments that the process has not yet received."""
        self._ended = False
        try:
            self._process.start()
        finally:
            # Held here too, the pipe would never be found closed. This end is closed when both threads have ended.
            there.close()
        threading.Thread(target=_read, args=(here, self._inbox), name=f"{name} reports", daemon=True).start()
        threading.Thread(target=_write, args=(here, self._outbox), name=f"{name} commands", daemon=True).start()

    @property
    def pid(self) -> int | None:
        """The process id."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """True if the process can take a call."""
        return not self._ended and self._process.is_alive()

    def call(self, argument: object) -> None:
        """Ask for a call; Answer or Failed follows.

        Raises InputError where there is not enough shared memory, and ProcessEndedError after `end`.
        """
        payload, block = sent(argument)
        with self._lock:
            self._given.append(block)
        self.send(Call(payload))
        if self._ended:
            self._release(len(self._given))
            raise ProcessEndedError("was ended")

    def send(self, command: Command) -> None:
        """Send a command; one that comes too late has no effect."""
        self._outbox.put(encode(command))

    def receive(self, seconds: float = 0.0) -> WorkerReport | None:
        """Return the next report; None where none comes within `seconds`. Raises ProcessEndedError after the last report of a
        process that has ended."""
        while True:
            try:
                report = self._inbox.get(seconds > 0.0, seconds)
            except queue.Empty:
                return None
            if report is None:
                self._inbox.put(None)
                raise ProcessEndedError(self._how_it_ended())
            if not isinstance(report, Received):
                return report
            self._release(1)

    def _how_it_ended(self) -> str:
        self._process.join(SECONDS_TO_END)
        code = self._process.exitcode
        if code is None:
            return "closed its pipe"
        return f"was killed by signal {-code}" if code < 0 else f"ended with status {code}"

    def _release(self, most: int) -> None:
        """Close the blocks of the oldest arguments, `most` of them."""
        with self._lock:
            for _ in range(min(most, len(self._given))):
                block = self._given.popleft()
                if block is not None:
                    block.close()

    def end(self) -> None:
        """End the process, in the middle of a call too, and give its shared memory back; may be called again, from any thread."""
        self._ended = True
        self._outbox.put(None)
        self._process.kill()
        self._process.join(SECONDS_TO_END)
        self._release(len(self._given))
