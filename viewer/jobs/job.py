"""A job: a function that runs in a thread beside the frames, with its progress and its result."""

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, wait
from typing import Generic, TypeVar

from ntc.errors import InputError

Result = TypeVar("Result")


class JobReport:
    """Progress of a running job. The job writes it; the window's thread reads it, and may cancel."""

    def __init__(self, changed: Callable[[], None] = lambda: None) -> None:
        """`changed` is called in the job's thread after each report."""
        self._changed = changed
        self.cancelled = False
        self.share = 0.0
        """Of the work done, 0 to 1."""
        self.partial: object = None
        """A first result to show until the job is done."""

    def progress(self, done: int, of: int) -> None:
        """Report that `done` of `of` steps are done. Raises CancelledError where the job is to end."""
        self.check()
        self.share = done / max(of, 1)
        self._changed()

    def show(self, partial: object) -> None:
        """Hand over a first result. Raises CancelledError where the job is to end."""
        self.partial = partial
        self.progress(0, 1)

    def check(self) -> None:
        """Raises CancelledError where the job is to end."""
        if self.cancelled:
            raise CancelledError


class Job(Generic[Result]):
    """One call of `work(report)`, and the `concurrent.futures.Future` of its result.

    The threads of `ThreadPoolExecutor` do not fit: Python waits for them when the program ends, however long their work takes.
    Those of jobs are daemons.
    """

    def __init__(self, work: Callable[[JobReport], Result], changed: Callable[[], None] = lambda: None) -> None:
        self._work = work
        self.report = JobReport(changed)
        self.future: Future[Result] = Future()

    def start(self, name: str) -> "Job[Result]":
        """Run in a new daemon thread called `name`."""
        threading.Thread(target=self.run, name=name, daemon=True).start()
        return self

    def run(self) -> None:
        """Run in this thread. Whatever the work raises becomes the exception of the future."""
        if self.future.set_running_or_notify_cancel():
            try:
                self.future.set_result(self._work(self.report))
            except BaseException as error:  # noqa: BLE001  It is raised again where the result is asked for.
                self.future.set_exception(error)

    def cancel(self) -> None:
        """Keep the job from starting, or end it at its next report."""
        self.report.cancelled = True
        self.future.cancel()

    def join(self, seconds: float) -> None:
        """Wait for the end, at most so long."""
        wait([self.future], seconds)

    @property
    def done(self) -> bool:
        """Whether there is a result, an error, or the job was cancelled."""
        return self.future.done()

    def result(self) -> Result:
        """What the work returned, once done. Raises CancelledError where it was cancelled, and InputError for every other error."""
        try:
            return self.future.result(0.0)
        except (InputError, CancelledError):
            raise
        except Exception as error:
            raise InputError(f"{type(error).__name__}: {error}") from error

    @property
    def problem(self) -> str:
        """The error that ended a job that is done, as one line; "" for none."""
        error = CancelledError("cancelled") if self.future.cancelled() else self.future.exception(0.0)
        return "" if error is None else " ".join(str(error).split()) or type(error).__name__
