"""Detection of a lost OpenGL context: the GPU was reset, or the driver restarted. What was drawn since is invalid."""

import ctypes
import functools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Concatenate, Final, Literal, ParamSpec, Protocol, TypeVar

from ntc.errors import InputError
from viewer.gl.systems import FunctionLoader

LOSE_VARIABLE: Final = "NTC_VIEWER_LOSE_CONTEXT_AT"
"""Environment variable for tests: numbers, from 1, of the checks that report a lost context, separated by commas."""
GL_NO_ERROR = 0
GL_CONTEXT_LOST = 0x0507
GL_UNKNOWN_RESET: Final = 0x8255
MOST_NUMBERS = 1000

Blame = Literal["guilty", "innocent", "unknown"]
BLAMES: Final[Mapping[int, Blame]] = {0x8253: "guilty", 0x8254: "innocent", GL_UNKNOWN_RESET: "unknown"}
"""Causes of a loss by the value of glGetGraphicsResetStatus; 0: not lost."""
CAUSES: Final[Mapping[Blame, str]] = {
    "guilty": "what this program drew was too much for it",
    "innocent": "another program was the cause",
    "unknown": "the cause is not known",
}
STATUS_NAMES = ("glGetGraphicsResetStatus", "glGetGraphicsResetStatusKHR", "glGetGraphicsResetStatusARB")
"""Names of the function of OpenGL 4.5, and of the extensions before it."""

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S", bound="_ContextUser")


class ContextLostError(Exception):
    """Error of a lost OpenGL context, with all objects on the GPU. The message is one line that names the cause."""

    def __init__(self, blame: Blame) -> None:
        super().__init__(f"the graphics driver was reset ({CAUSES[blame]})")
        self.blame: Final = blame


class SimulatedLosses:
    """Simulated losses: checks that report an intact context as lost. The count continues over all contexts of a run."""

    def __init__(self, at: frozenset[int] = frozenset()) -> None:
        self._at, self._checks = at, 0

    @classmethod
    def of_environment(cls, environment: Mapping[str, str] = os.environ) -> "SimulatedLosses":
        """Read the checks that LOSE_VARIABLE lists. Raises InputError for anything but numbers."""
        given = [part.strip() for part in environment.get(LOSE_VARIABLE, "").split(",") if part.strip()]
        if len(given) > MOST_NUMBERS or not all(part.isascii() and part.isdigit() and len(part) < 10 for part in given):
            raise InputError(f"{LOSE_VARIABLE}: must be numbers of checks, separated by commas, such as 40,80")
        return cls(frozenset(map(int, given)))

    def next_is_lost(self) -> bool:
        """Count one check, and return whether it reports a loss."""
        self._checks += 1
        return self._checks in self._at


class ResetStatus:
    """Reset status of one context. Call it from the context's thread only, with the context current.

    Drivers without the function, and contexts without robustness, never report a loss.
    """

    def __init__(self, load: FunctionLoader, simulated: SimulatedLosses | None = None) -> None:
        self._simulated = simulated or SimulatedLosses()
        call = ctypes.CFUNCTYPE(ctypes.c_uint)
        address = next((loaded for name in STATUS_NAMES if (loaded := load(name))), 0)
        self._status: Callable[[], int] = call(address) if address else lambda: GL_NO_ERROR
        error = load("glGetError")
        self._error: Callable[[], int] = call(error) if error else lambda: GL_NO_ERROR
        self._blame: Blame | None = None
        self.is_supported: Final = bool(address)
        """True where the driver has the function."""

    def check(self) -> None:
        """Raise ContextLostError if the context is lost, or was at an earlier check."""
        if self._blame is None:
            # The driver reports a loss only once, or until the reset is over, so it is stored.
            status = GL_UNKNOWN_RESET if self._simulated.next_is_lost() else self._status()
            if status == GL_NO_ERROR:
                return
            self._blame = BLAMES.get(status, "unknown")
        raise ContextLostError(self._blame)

    def check_after(self, error: BaseException) -> None:
        """Raise ContextLostError where a lost context caused `error`, also if only glGetError reports it."""
        try:
            if self._blame is None and self._error() == GL_CONTEXT_LOST:
                self._blame = BLAMES.get(self._status(), "unknown")
            self.check()
        except ContextLostError as lost:
            raise lost from error

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Check at the end of the block. ContextLostError replaces every error that a lost context caused."""
        try:
            yield
        except ContextLostError:
            raise
        except Exception as error:
            self.check_after(error)
            raise
        self.check()

    def wait_until_over(self, seconds: float) -> bool:
        """Wait for the end of the reset, before which no context can be created; return False if it takes longer than `seconds`."""
        end = time.monotonic() + seconds
        while self._status() != GL_NO_ERROR:
            if time.monotonic() >= end:
                return False
            time.sleep(0.02)
        return True


class _ContextUser(Protocol):
    reset: ResetStatus


def checks_context(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """Decorator for methods of objects with the attribute `reset`: raises ContextLostError instead of returning what a lost context
    drew, and in place of every error that a lost context caused."""

    @functools.wraps(method)
    def checked(owner: S, /, *arguments: P.args, **named: P.kwargs) -> R:
        with owner.reset.watched():
            return method(owner, *arguments, **named)

    return checked
