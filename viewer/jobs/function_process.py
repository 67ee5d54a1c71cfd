"""A function that is called in a process of its own: for work that keeps Python's interpreter lock, or needs other libraries."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

from ntc.errors import InputError, ProcessEndedError
from ntc.worker.process import SECONDS_TO_END, WindowEnd, WorkerProcess
from ntc.worker.protocol import Answer, Failed
from ntc.worker.shared_arrays import received
from viewer.jobs.job import Job, JobReport, Result

Argument = TypeVar("Argument")


def _without_window(function: Callable[[Argument], Result], argument: Argument, _window: WindowEnd) -> Result:
    return function(argument)


class FunctionProcess(Generic[Argument, Result]):
    """Calls `function`, one call at a time, in a process that stays for the next call until `close`."""

    def __init__(self, function: Callable[[Argument], Result], name: str, niceness: int = 0) -> None:
        """`function` is found by its module and name; `name` is that of the process, for error texts too."""
        self._function, self.name, self._niceness = function, name, niceness
        self._lock = threading.Lock()
        self._process: WorkerProcess | None = None
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
            process = self._started()
            process.call(argument)
            report = process.receive(waits=True)
        except (OSError, ProcessEndedError) as error:
            self._end()
            raise InputError(f"{self.name}: its process gave no answer ({error}); try again") from error
        if isinstance(report, Failed):
            raise InputError(report.line)
        assert isinstance(report, Answer)
        result: Result = received(report.value)
        return result

    def _started(self) -> WorkerProcess:
        with self._lock:
            if self._closed:
                raise ProcessEndedError("was ended")
            if self._process is None:
                self._process = WorkerProcess(partial(_without_window, self._function), self.name, self._niceness)
            return self._process

    def _end(self) -> None:
        with self._lock:
            if self._process is not None:
                self._process.end()
                self._process = None

    def close(self) -> None:
        """End the process, in the middle of a call too."""
        self._closed = True
        self._end()
        if self._job is not None:
            self._job.join(SECONDS_TO_END)
