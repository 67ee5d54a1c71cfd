"""Work that takes longer than a frame, one thing after the other in a thread of its own."""

import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from ntc.errors import InputError
from viewer.state.message_log import details_of

Result = TypeVar("Result")
RESULTS_KEPT = 8


class JobCancelledError(Exception):
    """Raised inside a job that nobody waits for any more."""


@dataclass(frozen=True)
class Finished(Generic[Result]):
    """What became of a job."""

    value: Result | None
    problem: str = ""
    """One line; "" where it went well."""
    details: str = ""


class JobReport:
    """What a running job tells, and is told."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self.cancelled = False
        self.share = 0.0
        """Of the work done, 0 to 1."""
        self.partial: object = None
        """A first result that is shown until the job is done."""

    def progress(self, done: int, of: int) -> None:
        """Say how far the job is. Raises JobCancelledError where it should end."""
        if self.cancelled:
            raise JobCancelledError
        self.share = done / max(of, 1)
        self._changed()

    def show(self, partial: object) -> None:
        """Hand over a first result. Raises JobCancelledError where the job should end."""
        self.partial = partial
        self.progress(0, 1)


Job = Callable[[JobReport], object]


class Background:
    """Runs jobs by key; asks for a frame whenever there is something new to show. Called from the window's thread."""

    def __init__(self) -> None:
        self._lock = threading.Condition()
        self._waiting: OrderedDict[Hashable, tuple[Job, JobReport]] = OrderedDict()
        self._running: tuple[Hashable, JobReport] | None = None
        self._finished: dict[Hashable, Finished[object]] = {}
        self._order: deque[Hashable] = deque()
        self._thread: threading.Thread | None = None
        self._news = False
        self._closing = False

    def ask(self, key: Hashable, job: Job) -> Finished[object] | JobReport:
        """The result of `job` under `key`, or how far it is; it is started where nobody has asked for it before."""
        with self._lock:
            if key in self._finished:
                return self._finished[key]
            if self._running is not None and self._running[0] == key and not self._running[1].cancelled:
                return self._running[1]
            if key not in self._waiting:
                self._waiting[key] = (job, JobReport(self._note_news))
                if self._thread is None:
                    self._thread = threading.Thread(target=self._work, name="explore", daemon=True)
                    self._thread.start()
                self._lock.notify()
            return self._waiting[key][1]

    def cancel(self, key: Hashable) -> None:
        """Nobody waits for this any more."""
        with self._lock:
            self._waiting.pop(key, None)
            if self._running is not None and self._running[0] == key:
                self._running[1].cancelled = True

    def forget(self) -> None:
        """Nobody waits for anything any more, and all results go: what they are about is closed."""
        with self._lock:
            self._waiting.clear()
            self._finished.clear()
            self._order.clear()
            if self._running is not None:
                self._running[1].cancelled = True

    def take_news(self) -> bool:
        """Whether there is something new since the last call."""
        news, self._news = self._news, False
        return news

    @property
    def is_busy(self) -> bool:
        """Whether something runs or waits."""
        with self._lock:
            return self._running is not None or bool(self._waiting)

    def close(self) -> None:
        """End the thread; jobs end at their next report."""
        with self._lock:
            self._closing = True
            self._waiting.clear()
            if self._running is not None:
                self._running[1].cancelled = True
            self._lock.notify()
        if self._thread is not None:
            # A job that does not report for long must not keep the window from closing: the thread is a daemon.
            self._thread.join(timeout=2.0)
            self._thread = None

    def _note_news(self) -> None:
        self._news = True

    def _work(self) -> None:
        while True:
            with self._lock:
                while not self._waiting and not self._closing:
                    self._lock.wait()
                if self._closing:
                    return
                # The latest wish first: it is what is looked at.
                key, (job, report) = self._waiting.popitem(last=True)
                self._running = (key, report)
            finished = self._run(job, report)
            with self._lock:
                self._running = None
                if finished is not None and not report.cancelled:
                    self._finished[key] = finished
                    self._order.append(key)
                    while len(self._order) > RESULTS_KEPT:
                        self._finished.pop(self._order.popleft(), None)
            self._news = True

    @staticmethod
    def _run(job: Job, report: JobReport) -> Finished[object] | None:
        try:
            return Finished(job(report))
        except JobCancelledError:
            return None
        except (InputError, ValueError, MemoryError, OSError) as error:
            return Finished(None, " ".join(str(error).split()) or type(error).__name__, details_of(error))
