"""Where a script is played, and what it can expect there."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol

from ntc.errors import InputError
from viewer.commands.command import Context
from viewer.state.session import Session
from viewer.ui.widgets import WidgetRects

Turn = Literal["frame", "rest"]
"""What a script waits for: the next frame, or a moment in which one is drawn only where it shows something else."""


class Stage(Protocol):
    """What a script needs of the program that plays it: the window, or its content without one."""

    session: Session
    context: Context

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the window's content in pixels."""
        ...

    @property
    def is_settled(self) -> bool:
        """Whether nothing is to come that the next frames would show."""
        ...

    @property
    def is_opening(self) -> bool:
        """Whether a file is still to be opened."""
        ...

    @property
    def is_closing(self) -> bool:
        """Whether the window is to be closed."""
        ...

    @property
    def widgets(self) -> WidgetRects:
        """The labelled widgets of the last frame."""
        ...

    def resize(self, size: tuple[int, int]) -> None:
        """Give the window's content this size, from the next frame on."""
        ...

    def open_files(self, paths: list[Path]) -> None:
        """Open files, as when they are dropped on the window."""
        ...


def _switch(value: bool) -> str:
    return "on" if value else "off"


PROPERTIES: dict[str, Callable[[Stage], str]] = {
    "source": lambda stage: stage.session.view.slot_a.source,
    "source-b": lambda stage: stage.session.view.slot_b.source,
    "path": lambda stage: stage.session.view.slot_a.path,
    "path-b": lambda stage: stage.session.view.slot_b.path,
    "precision": lambda stage: stage.session.view.slot_a.precision,
    "precision-b": lambda stage: stage.session.view.slot_b.precision,
    "filter": lambda stage: stage.session.view.slot_a.filter,
    "filter-b": lambda stage: stage.session.view.slot_b.filter,
    "mode": lambda stage: stage.session.view.compare,
    "divider": lambda stage: f"{stage.session.view.wipe_position:.2f}",
    "overlay": lambda stage: stage.session.view.overlay.kind,
    "camera": lambda stage: stage.session.view.camera.name,
    "scene": lambda stage: stage.session.scene.name,
    "resolution": lambda stage: f"{stage.session.resolution:g}",
    "size": lambda stage: "{}x{}".format(*stage.size),
    "panels": lambda stage: _switch(stage.session.window.show_panels),
    "help": lambda stage: _switch(stage.session.window.show_help),
    "palette": lambda stage: _switch(stage.session.window.palette is not None),
    "question": lambda stage: stage.session.window.question.title if stage.session.window.question else "",
    "moving": lambda stage: _switch(stage.session.is_moving),
    "training": lambda stage: stage.context.training.state,
    "waiting": lambda stage: _switch(not stage.is_settled),
    "toast": lambda stage: " | ".join(toast.text for toast in stage.session.window.toasts),
    "label": lambda stage: " | ".join(stage.widgets.labels()),
}
"""By name. `toast`, `label` and `question` need only contain what is expected."""
CONTAIN = ("toast", "label", "question")


def expect(name: str, value: str, stage: Stage) -> None:
    """Raise InputError where the property is otherwise."""
    found = PROPERTIES[name](stage)
    if (value not in found) if name in CONTAIN else (value != found):
        verb = "contains" if name in CONTAIN else "is"
        raise InputError(f"expected that {name} {verb} {value!r}; it is {found[:300]!r}")
