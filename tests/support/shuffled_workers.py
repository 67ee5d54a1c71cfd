"""Workers in the caller's thread, whose jobs end in any order."""

import random
from collections.abc import Callable
from concurrent.futures import Future
from typing import Generic

from viewer.jobs.executor import Argument, Result, Workers


class ShuffledWorkers(Generic[Argument, Result]):
    """A job ends when all slots are taken, or none was taken since the last question for slots; `seed` decides which one."""

    def __init__(self, function: Callable[[Argument], Result], seed: int, slots: int = 4) -> None:
        self.jobs = list[Argument]()
        """Jobs in the order in which they ended."""
        self.most = 0
        """Largest number of jobs at the same time."""
        self.workers = Workers[Argument, Result](self._slots, self._submit)
        self._function, self._count, self._random = function, slots, random.Random(seed)
        self._waiting = list[tuple[Argument, Future[Result]]]()
        self._submitted = False

    def _slots(self) -> int:
        if not self._submitted:
            self._end_one()
        self._submitted = False
        return self._count

    def _submit(self, argument: Argument) -> Future[Result]:
        future = Future[Result]()
        self._waiting.append((argument, future))
        self._submitted, self.most = True, max(self.most, len(self._waiting))
        if len(self._waiting) == self._count:
            self._end_one()
        return future

    def _end_one(self) -> None:
        if self._waiting:
            argument, future = self._waiting.pop(self._random.randrange(len(self._waiting)))
            self.jobs.append(argument)
            try:
                future.set_result(self._function(argument))
            except Exception as error:  # noqa: BLE001  As a worker does.
                future.set_exception(error)
