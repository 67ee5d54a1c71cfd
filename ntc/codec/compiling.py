"""Loops that numba compiles.

The first encoding on a machine compiles them, which takes up to a minute. numba keeps the code beside the file, or in the user's cache
folder where that one cannot be written, or in the folder that `NUMBA_CACHE_DIR` names.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])
Signatures = Mapping[Any, tuple[Any, ...]]
"""Compiled functions, each with numba's types of the arguments that encoders call it with."""


def compiled_loop(**options: Any) -> Callable[[Function], Function]:
    """Return a decorator that compiles a function, which then runs without Python's lock. `options` are those of `numba.njit`.

    The code is kept for later processes, where there is a folder to keep it in.
    """

    def compiled(function: Function) -> Function:
        try:
            loop: Function = njit(nogil=True, cache=True, **options)(function)
        except RuntimeError:
            # No folder can be written: each process compiles.
            loop = njit(nogil=True, **options)(function)
        return loop

    return compiled
