"""How long work is paused and cancelled."""

from collections.abc import Callable

CancelQuestion = Callable[[], bool]
Interruption = Callable[[], None]
"""Called many times while work goes on. It may wait, and the work continues when it returns; what it raises ends the work."""


def no_interruption() -> None:
    """Lets work continue."""
