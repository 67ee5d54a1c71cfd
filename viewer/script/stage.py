"""Where a script is played: the window, or its content without one."""

from typing import Protocol

from viewer.app.frontend import Frontend
from viewer.state.session import Session


class Stage(Protocol):
    """What a script needs of a program around a frontend."""

    session: Session
    frontend: Frontend

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the window's content in pixels."""
        ...

    def resize(self, size: tuple[int, int]) -> None:
        """Give the window's content this size, from the next frame on."""
        ...
