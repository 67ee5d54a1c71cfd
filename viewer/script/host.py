"""Host of a script: the program that plays it, and the properties that it can check."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol

from ntc.errors import InputError
from viewer.commands.command import Context
from viewer.state.session import Session
from viewer.ui.widgets import WidgetRects

Turn = Literal["frame", "rest"]
"""Turn of a script: `frame` needs the next frame; `rest` waits, and a frame is drawn only where something changes."""


class ScriptHost(Protocol):
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


PROPERTIES: dict[str, Callable[[ScriptHost], str]] = {
    "source": lambda host: host.session.view.slot_a.source,
    "source-b": lambda host: host.session.view.slot_b.source,
    "path": lambda host: host.session.view.slot_a.path,
    "path-b": lambda host: host.session.view.slot_b.path,
    "precision": lambda host: host.session.view.slot_a.precision,
    "precision-b": lambda host: host.session.view.slot_b.precision,
    "filter": lambda host: host.session.view.slot_a.filter,
    "filter-b": lambda host: host.session.view.slot_b.filter,
    "mode": lambda host: host.session.view.compare,
    "divider": lambda host: f"{host.session.view.wipe_position:.2f}",
    "overlay": lambda host: host.session.view.overlay.kind,
    "camera": lambda host: host.session.view.camera.name,
    "scene": lambda host: host.session.scene.name,
    "resolution": lambda host: f"{host.session.resolution:g}",
    "size": lambda host: "{}x{}".format(*host.size),
    "panels": lambda host: _switch(host.session.window.show_panels),
    "help": lambda host: _switch(host.session.window.show_help),
    "palette": lambda host: _switch(host.session.window.palette is not None),
    "moving": lambda host: _switch(host.session.is_moving),
    "training": lambda host: host.context.training.state,
    "waiting": lambda host: _switch(not host.is_settled),
    "toast": lambda host: " | ".join(toast.text for toast in host.session.window.toasts),
    "label": lambda host: " | ".join(host.widgets.labels()),
}
"""Properties by name. `toast` and `label` need only contain the expected text."""
CONTAIN = ("toast", "label")


def expect(name: str, value: str, host: ScriptHost) -> None:
    """Check that a property has, or contains, `value`. Raises InputError where it does not."""
    actual = PROPERTIES[name](host)
    if (value not in actual) if name in CONTAIN else (value != actual):
        verb = "contains" if name in CONTAIN else "is"
        raise InputError(f"expected that {name} {verb} {value!r}; it is {actual[:300]!r}")
