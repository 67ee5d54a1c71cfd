"""How the training process is started."""

import multiprocessing
import socket
from typing import Protocol

from ntc.worker.process import serve


class TrainingProcess(Protocol):
    """What the window needs of a process: `multiprocessing.Process`, or a stand-in of tests."""

    @property
    def pid(self) -> int | None:
        """Its number."""

    @property
    def exitcode(self) -> int | None:
        """None while it lives; negative: the signal that killed it."""

    def is_alive(self) -> bool:
        """Whether it lives."""

    def kill(self) -> None:
        """End it at once."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end, at most so many seconds."""

    def close(self) -> None:
        """Give back what belongs to it. Raises ValueError while it lives."""


def start_process(end: socket.socket) -> TrainingProcess:
    """A process that serves the other end of the pipe and ends with this one. Raises OSError where none can be started."""
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(end,), name="ntc-training", daemon=True)
    process.start()
    return process
