"""What a script can expect of the window, as text."""

from collections.abc import Callable

from ntc.errors import InputError
from viewer.script.stage import Stage

Property = Callable[[Stage], str]


def _switch(value: bool) -> str:
    return "on" if value else "off"


PROPERTIES: dict[str, Property] = {
    "source": lambda stage: stage.session.view.slot_a.source,
    "source-b": lambda stage: stage.session.view.slot_b.source,
    "path": lambda stage: stage.session.view.slot_a.path,
    "path-b": lambda stage: stage.session.view.slot_b.path,
    "precision": lambda stage: stage.session.view.slot_a.precision,
    "precision-b": lambda stage: stage.session.view.slot_b.precision,
    "mode": lambda stage: stage.session.view.compare,
    "divider": lambda stage: f"{stage.session.view.wipe_position:.2f}",
    "overlay": lambda stage: stage.session.view.overlay.kind,
    "camera": lambda stage: stage.session.view.camera.name,
    "scene": lambda stage: stage.session.scene.name,
    "resolution": lambda stage: f"{stage.session.resolution:g}",
    "size": lambda stage: "{}x{}".format(*stage.size),
    "panels": lambda stage: _switch(stage.session.show_panels),
    "help": lambda stage: _switch(stage.session.show_help),
    "palette": lambda stage: _switch(stage.session.palette is not None),
    "moving": lambda stage: _switch(stage.session.motion is not None),
    "waiting": lambda stage: _switch(not stage.frontend.is_settled(stage.size)),
    "toast": lambda stage: " | ".join(toast.text for toast in stage.session.toasts),
    "label": lambda stage: " | ".join(stage.frontend.interface.items.labels()),
}
"""By name. `toast` and `label` need only contain what is expected."""
CONTAIN = ("toast", "label")


def expect(name: str, value: str, stage: Stage) -> None:
    """Raise InputError where the property is otherwise."""
    found = PROPERTIES[name](stage)
    if (value not in found) if name in CONTAIN else (value != found):
        verb = "contains" if name in CONTAIN else "is"
        raise InputError(f"expected that {name} {verb} {value!r}; it is {found[:300]!r}")
