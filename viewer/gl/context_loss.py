"""Whether the OpenGL context is lost: the GPU was reset, or the driver restarted. Nothing that was drawn since is to be trusted."""

import ctypes
import functools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Concatenate, Final, Literal, ParamSpec, TypeVar

from ntc.errors import InputError
from viewer.gl.functions import FunctionLoader

LOSE_VARIABLE: Final = "NTC_VIEWER_LOSE_CONTEXT_AT"
"""Environment variable for tests: numbers, separated by commas, of the checks that find the context lost, counted from 1."""
GL_NO_ERROR = 0
GL_CONTEXT_LOST = 0x0507
GL_UNKNOWN_RESET: Final = 0x8255
MOST_NUMBERS = 1000

Blame = Literal["guilty", "innocent", "unknown"]
BLAMES: Final[Mapping[int, Blame]] = {0x8253: "guilty", 0x8254: "innocent", GL_UNKNOWN_RESET: "unknown"}
"""By what glGetGraphicsResetStatus returns; 0 is none."""
CAUSES: Final[Mapping[Blame, str]] = {
    "guilty": "what this program drew was too much for it",
    "innocent": "another program was the cause",
    "unknown": "the cause is not known",
}
STATUS_NAMES = ("glGetGraphicsResetStatus", "glGetGraphicsResetStatusKHR", "glGetGraphicsResetStatusARB")
"""OpenGL 4.5, and the extensions that it comes from."""

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S")


class ContextLostError(Exception):
    """The OpenGL context is lost with all that was on the GPU. The message is one line that says what happened."""

    def __init__(self, blame: Blame) -> None:
        super().__init__(f"the graphics driver was reset ({CAUSES[blame]})")
        self.blame: Final = blame


class SimulatedLosses:
    """Which checks find a context lost that is not. One for the whole run: it counts on over contexts."""

    def __init__(self, at: frozenset[int] = frozenset()) -> None:
        self._at, self._checks = at, 0

    @classmethod
    def of_environment(cls, environment: Mapping[str, str] = os.environ) -> "SimulatedLosses":
        """What LOSE_VARIABLE says. Raises InputError for anything but numbers."""
        given = [part.strip() for part in environment.get(LOSE_VARIABLE, "").split(",") if part.strip()]
        if len(given) > MOST_NUMBERS or not all(part.isascii() and part.isdigit() and len(part) < 10 for part in given):
            raise InputError(f"{LOSE_VARIABLE}: must be numbers of checks, separated by commas, such as 40,80")
        return cls(frozenset(map(int, given)))

    def strikes(self) -> bool:
        """Whether the context is lost at this check, the next one."""
        self._checks += 1
        return self._checks in self._at


class ResetStatus:
    """What the driver says of one context. All calls belong to its thread, with the context current.

    A driver without the function, and a context that is not robust, never tell: the context then counts as whole.
    """

    def __init__(self, load: FunctionLoader, simulated: SimulatedLosses | None = None) -> None:
        self._simulated = simulated or SimulatedLosses()
        call = ctypes.CFUNCTYPE(ctypes.c_uint)
        address = next((found for name in STATUS_NAMES if (found := load(name))), 0)
        self._status: Callable[[], int] = call(address) if address else lambda: GL_NO_ERROR
        error = load("glGetError")
        self._error: Callable[[], int] = call(error) if error else lambda: GL_NO_ERROR
        self._blame: Blame | None = None
        self.can_tell: Final = bool(address)
        """Whether the driver has the function."""

    def check(self) -> None:
        """Raise ContextLostError if the context is lost; once it was, always."""
        if self._blame is None:
            # The driver says it once or until the reset is over, so that it must be kept.
            status = GL_UNKNOWN_RESET if self._simulated.strikes() else self._status()
            if status == GL_NO_ERROR:
                return
            self._blame = BLAMES.get(status, "unknown")
        raise ContextLostError(self._blame)

    def check_after(self, error: BaseException) -> None:
        """Raise ContextLostError where a lost context is behind `error`: also if only OpenGL's own error says so."""
        try:
            if self._blame is None and self._error() == GL_CONTEXT_LOST:
                self._blame = BLAMES.get(self._status(), "unknown")
            self.check()
        except ContextLostError as lost:
            raise lost from error

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Check at the end of a block; ContextLostError takes the place of every error that has a lost context behind it."""
        try:
            yield
        except ContextLostError:
            raise
        except Exception as error:
            self.check_after(error)
            raise
        self.check()

    def wait_until_over(self, seconds: float) -> bool:
        """Wait for the end of the reset, before which no new context is to be had; False if it goes on for `seconds`."""
        end = time.monotonic() + seconds
        while self._status() != GL_NO_ERROR:
            if time.monotonic() >= end:
                return False
            time.sleep(0.02)
        return True


def checks_context(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """For methods of what has a GraphicsContext as `_context`: nothing that a lost context drew is returned.

    ContextLostError is raised instead, and in place of every error that has a lost context behind it.
    """

    @functools.wraps(method)
    def checked(drawing: S, /, *arguments: P.args, **named: P.kwargs) -> R:
        reset: ResetStatus = drawing._context.reset  # type: ignore[attr-defined]
        with reset.watched():
            return method(drawing, *arguments, **named)

    return checked
