"""Stage of a script: the program that plays it, and the properties that it can check."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol

from ntc.errors import InputError
from viewer.commands.command import Context
from viewer.state.session import Session
from viewer.ui.widgets import WidgetRects

Turn = Literal["frame", "rest"]
"""Turn of a script: `frame` needs the next frame; `rest` waits, and a frame is drawn only where something changes."""


class Stage(Protocol):
    """Program that plays a script: the window, or its content without a window."""

    session: Session
    context: Context

    @property
    def size(self) -> tuple[int, int]:
        """Size (width, height) of the window's content in pixels."""
        ...

    @property
    def is_settled(self) -> bool:
        """True where further frames would show nothing new."""
        ...

    @property
    def is_opening(self) -> bool:
        """True while a file is being opened."""
        ...

    @property
    def is_closing(self) -> bool:
        """True where the window is closing."""
        ...

    @property
    def widgets(self) -> WidgetRects:
        """Labelled widgets of the last frame."""
        ...

    def resize(self, size: tuple[int, int]) -> None:
        """Resize the window's content, from the next frame on."""
        ...

    def open_files(self, paths: list[Path]) -> None:
        """Open files like files that the user drops on the window."""
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
    "moving": lambda stage: _switch(stage.session.is_moving),
    "training": lambda stage: stage.context.training.state,
    "waiting": lambda stage: _switch(not stage.is_settled),
    "toast": lambda stage: " | ".join(toast.text for toast in stage.session.window.toasts),
    "label": lambda stage: " | ".join(stage.widgets.labels()),
}
"""Properties by name. `toast` and `label` need only contain the expected text."""
CONTAIN = ("toast", "label")


def expect(name: str, value: str, stage: Stage) -> None:
    """Check that a property has, or contains, `value`. Raises InputError where it does not."""
    actual = PROPERTIES[name](stage)
    if (value not in actual) if name in CONTAIN else (value != actual):
        verb = "contains" if name in CONTAIN else "is"
        raise InputError(f"expected that {name} {verb} {value!r}; it is {actual[:300]!r}")
