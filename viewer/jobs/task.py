"""Work in a thread beside the window, asked for its result from time to time."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from ntc.errors import InputError
from viewer.training.grouping_process import StoppedError

T = TypeVar("T")


class Task(Generic[T]):
    """Runs `work(stopped)` at once. The thread ends soon after `stop`, and keeps no program from ending."""

    def __init__(self, work: Callable[[Callable[[], bool]], T]) -> None:
        self._work = work
        self._stop = threading.Event()
        self._result: T | None = None
        self._error: str | None = None
        self._stopped = False
        self._thread = threading.Thread(target=self._run, daemon=True, name="ntc-training-task")
        self._thread.start()

    def _run(self) -> None:
        try:
            self._result = self._work(self._stop.is_set)
        except StoppedError:
            self._stopped = True
        except InputError as error:
            self._error = str(error)
        except Exception as error:
            # The window must go on, and must not wait for ever.
            self._error = f"training: {type(error).__name__}: {' '.join(str(error).split())}"

    @property
    def done(self) -> bool:
        """Whether there is a result, or an error."""
        return not self._thread.is_alive()

    def stop(self) -> None:
        """The result is no longer wanted."""
        self._stop.set()

    def join(self, seconds: float) -> None:
        """Wait for the end, at most so long."""
        self._thread.join(seconds)

    def result(self) -> T | None:
        """What came of it, None where it was stopped. Raises InputError with what went wrong."""
        if self._error is not None:
            raise InputError(self._error)
        return None if self._stopped else self._result
