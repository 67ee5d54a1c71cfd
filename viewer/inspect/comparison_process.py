"""Comparisons in a process of their own: FLIP keeps Python's interpreter lock, and frames must not wait for it."""

import multiprocessing
import signal
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from viewer.inspect.comparison import Comparison, PairOfPictures, compare

SECONDS_TO_CLOSE = 0.5


def serve(connection: Connection) -> None:
    """The process: compares what it is given until the other end of the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        while True:
            pair: PairOfPictures = connection.recv()
            try:
                connection.send(compare(pair))
            except MemoryError as error:
                connection.send(f"not enough memory to compare ({error})")


class ComparisonProcess:
    """One comparison at a time. `start` and `take` return at once; a thread waits in between. To be closed at the end."""

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._thread: threading.Thread | None = None
        self._answer: Comparison | str | None = None
        self._closed = False

    @property
    def busy(self) -> bool:
        """Whether a comparison is under way, or its result has not been taken."""
        return self._thread is not None

    @property
    def is_ready(self) -> bool:
        """Whether there is a result to take."""
        return self._thread is not None and not self._thread.is_alive()

    def start(self, pair: PairOfPictures) -> None:
        """Begin; not while busy."""
        if self._thread is not None:
            raise RuntimeError("a comparison is under way")
        self._answer = None
        self._thread = threading.Thread(target=self._ask, args=(pair,), name="comparison", daemon=True)
        self._thread.start()

    def take(self) -> Comparison | str | None:
        """The result, or why there is none; None while there is nothing to take."""
        if self._thread is None or self._thread.is_alive():
            return None
        self._thread.join()
        self._thread = None
        return self._answer

    def _ask(self, pair: PairOfPictures) -> None:
        try:
            connection = self._connected()
            connection.send(pair)
            self._answer = connection.recv()
        except (OSError, EOFError) as error:
            self._answer = f"no comparison: its process has ended ({error or 'no answer'})"
            self._end()

    def _connected(self) -> Connection:
        if self._connection is not None:
            return self._connection
        context = multiprocessing.get_context("spawn")
        connection, other_end = context.Pipe()
        try:
            process = context.Process(target=serve, args=(other_end,), name="ntc-comparison", daemon=True)
            process.start()
        finally:
            # Held here too, the pipe would never be found closed.
            other_end.close()
        self._connection, self._process = connection, process
        if self._closed:
            self._end()
            raise EOFError("closed")
        return connection

    def _end(self) -> None:
        connection, process = self._connection, self._process
        self._connection = self._process = None
        if process is not None:
            process.kill()
            process.join(SECONDS_TO_CLOSE)
        if connection is not None:
            with suppress(OSError):
                connection.close()

    def close(self) -> None:
        """End the process, whatever it is at."""
        self._closed = True
        process = self._process
        if process is not None:
            # The thread then reads the end of the pipe and closes it.
            process.kill()
        if self._thread is not None:
            self._thread.join(SECONDS_TO_CLOSE)
        self._end()
