"""The helper processes: they call plain functions for threads that wait, and end when nothing has asked for them for a while."""

import math
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from ntc.errors import InputError, ProcessEndedError
from ntc.worker.process import Answer, Failed, Part, Taken, WindowEnd, WorkerProcess
from ntc.worker.shared_arrays import inside, received

IDLE_SECONDS = 30.0
"""Time after which a helper without a call ends, in seconds: it gives hundreds of megabytes back."""
NICENESS = 10
"""Priority of helpers, below that of frames."""
SECONDS_BETWEEN_CHECKS = 0.05
Argument = TypeVar("Argument")
Result = TypeVar("Result")


class HelperReport:
    """Receiver of progress in a helper; the caller gets the newest that it has time for."""

    def __init__(self, window: WindowEnd) -> None:
        self._window = window

    def progress(self, done: int, of: int) -> None:
        """Send that `done` of `of` steps are done."""
        if not self._window.is_untaken(None):
            self._window.send_part(None, inside((done, of)))


def _help(call: tuple[Callable[..., Any], Any, bool], window: WindowEnd) -> object:
    """Call a function, in a helper."""
    function, argument, reports = call
    return function(argument, HelperReport(window)) if reports else function(argument)


class Helpers:
    """A pool of helpers, as many as there are calls at the same time. Any thread may call."""

    def __init__(self, idle_seconds: float = IDLE_SECONDS, niceness: int = NICENESS) -> None:
        """Make an empty pool, whose helpers end after `idle_seconds` without a call; infinite keeps them."""
        self._idle_seconds, self._niceness = idle_seconds, niceness
        self._lock = threading.Lock()
        self._idle: dict[WorkerProcess, threading.Timer | None] = {}
        """Helpers without a call, and what ends them; the last used one is the last."""
        self._busy: set[WorkerProcess] = set()
        self._closed = False

    def call(
        self,
        name: str,
        function: Callable[..., Result],
        argument: object,
        check: Callable[[], None] = lambda: None,
        progress: Callable[[int, int], None] | None = None,
        alone: bool = False,
    ) -> Result:
        """Return `function(argument)`, called in a helper. `name` is that of the work, for error texts.

        `function` is found by its module and name. With `progress` it also gets a HelperReport, and `progress` is called with what it
        reports. `check` is called meanwhile: what it raises ends the helper, in the middle of the work. `alone` ends the helper with
        the call: what draws with OpenGL must not share a process with other compilers.

        Raises InputError for what the function raises, and where the helper ends without an answer.
        """
        try:
            helper = self._taken(alone)
            try:
                helper.call((function, argument, progress is not None))
                while not isinstance(report := helper.receive(SECONDS_BETWEEN_CHECKS), Answer | Failed):
                    check()
                    if isinstance(report, Part):
                        helper.send(Taken(report.key))
                        if progress is not None:
                            progress(*received(report.value))
            except BaseException:
                self._end(helper)
                raise
        except (OSError, ProcessEndedError) as error:
            raise InputError(f"{name}: its process gave no answer ({error}); try again") from error
        if alone:
            self._end(helper)
        else:
            self._put_back(helper)
        if isinstance(report, Failed):
            raise InputError(report.line)
        result: Result = received(report.value)
        return result

    def _taken(self, alone: bool) -> WorkerProcess:
        """Return an idle helper, else a new one, which is busy from now on. Raises OSError where none can be started, and
        ProcessEndedError after `close`."""
        with self._lock:
            if self._closed:
                raise ProcessEndedError("was ended")
            while self._idle and not alone:
                helper, timer = self._idle.popitem()
                if timer is not None:
                    timer.cancel()
                if helper.is_alive:
                    break
                helper.end()
            else:
                helper = WorkerProcess(_help, "ntc-helper", self._niceness)
            self._busy.add(helper)
            return helper

    def _put_back(self, helper: WorkerProcess) -> None:
        with self._lock:
            self._busy.discard(helper)
            timer = None
            if math.isfinite(self._idle_seconds):
                timer = threading.Timer(self._idle_seconds, self._end_idle, (helper,))
                timer.daemon = True
                timer.start()
            self._idle[helper] = timer

    def _end_idle(self, helper: WorkerProcess) -> None:
        with self._lock:
            # A call may have taken it just now.
            if helper not in self._idle:
                return
            del self._idle[helper]
        helper.end()

    def _end(self, helper: WorkerProcess) -> None:
        with self._lock:
            self._busy.discard(helper)
        helper.end()

    def close(self) -> None:
        """End all helpers, in the middle of calls too; further calls raise InputError."""
        with self._lock:
            self._closed = True
            helpers = [*self._idle, *self._busy]
            self._idle.clear()
        for helper in helpers:
            helper.end()


HELPERS = Helpers()
"""The helpers of this program."""
