"""A function that is called in a process of its own: for work that keeps Python's interpreter lock, or needs other libraries."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Generic, TypeVar

from ntc.errors import InputError
from viewer.jobs.job import Job, JobReport, Result

Argument = TypeVar("Argument")
SECONDS_TO_CLOSE = 0.5


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)


def _answer(function: Callable[[Argument], Result], argument: Argument, _report: JobReport) -> Result:
    return function(argument)


def _serve(connection: Connection, function: Callable[[Argument], Result], niceness: int) -> None:
    """The process: answers every argument until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    with suppress(EOFError, OSError):
        while True:
            call = Job(partial(_answer, function, connection.recv()))
            call.run()
            try:
                connection.send(call.result())
            except InputError as error:
                connection.send(error)


class FunctionProcess(Generic[Argument, Result]):
    """Calls `function`, one call at a time, in a spawned process that stays for the next call until `close`.

    `ProcessPoolExecutor` does not fit: its workers cannot be ended in the middle of a call, and outlive a parent that was killed.
    """

    def __init__(self, function: Callable[[Argument], Result], name: str, niceness: int = 0) -> None:
        """`function` is found by its module and name; `name` is that of the process, for error texts too."""
        self._function, self.name, self._niceness = function, name, niceness
        self._lock = threading.Lock()
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._job: Job[Result] | None = None
        self._closed = False

    def call(self, argument: Argument) -> Job[Result]:
        """Begin a call; the one before must have ended. A thread waits for the answer.

        The job raises InputError for what the function raises, and where the process ends without an answer.
        """
        self._job = Job(partial(self._call, argument)).start(self.name)
        return self._job

    def _call(self, argument: Argument, _report: JobReport) -> Result:
        try:
            connection = self._connected()
            connection.send(argument)
            answer: Result | InputError = connection.recv()
        except (OSError, EOFError) as error:
            self._end()
            raise InputError(
                f"{self.name}: its process gave no answer ({error or 'it has ended'}); try again"
            ) from error
        if isinstance(answer, InputError):
            raise answer
        return answer

    def _connected(self) -> Connection:
        with self._lock:
            if self._closed:
                raise EOFError("closed")
            if self._connection is None:
                context = multiprocessing.get_context("spawn")
                here, there = context.Pipe()
                arguments = (there, self._function, self._niceness)
                self._process = context.Process(target=_serve, args=arguments, name=self.name, daemon=True)
                self._connection = here
                try:
                    self._process.start()
                finally:
                    # Held here too, the pipe would never be found closed.
                    there.close()
            return self._connection

    def _kill(self) -> None:
        with self._lock:
            if self._process is not None and self._process.pid is not None:
                self._process.kill()

    def _end(self) -> None:
        self._kill()
        with self._lock:
            process, connection = self._process, self._connection
            self._process = self._connection = None
        if process is not None and process.pid is not None:
            process.join(SECONDS_TO_CLOSE)
        if connection is not None:
            with suppress(OSError):
                connection.close()

    def close(self) -> None:
        """End the process, in the middle of a call too."""
        self._closed = True
        self._kill()
        if self._job is not None:
            # Its thread reads the end of the pipe, which must not be closed under it.
            self._job.join(SECONDS_TO_CLOSE)
        self._end()
