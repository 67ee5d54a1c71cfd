"""Commands that quit, or close the topmost layer over the picture."""

from dataclasses import replace

from viewer.commands.command import command, gesture
from viewer.commands.effects import CancelOpening, CloseWindow, Effect
from viewer.state.session import Session

cancel_opening = gesture("file.cancel-opening")(lambda _session: CancelOpening())


@command("file.quit", "Quit", "close the window; unsaved runs stay in the list of the panel Training", "Ctrl+Q")
def quit_window(_session: Session) -> Effect:
    return CloseWindow()


LAYERS = {
    "window.palette": None,
    "window.show_help": False,
    "window.show_glossary": False,
    "window.file_dialog": False,
    "window.show_first_steps": False,
    "inspection.flat_texture": None,
}
"""Layers over the picture, topmost first: attribute of the session that opens the layer -> its value while closed."""


def _close(session: Session, layer: str) -> bool:
    """Close one of LAYERS. Returns True where it was open."""
    group, _, name = layer.partition(".")
    is_open = bool(getattr(getattr(session, group), name) != LAYERS[layer])
    setattr(getattr(session, group), name, LAYERS[layer])
    if is_open and name == "show_first_steps":
        session.settings = replace(session.settings, first_steps=False)
    return is_open


@gesture("window.close-layer")
def close_layer(session: Session, layer: str) -> None:
    _close(session, layer)


def _forget_places(session: Session) -> bool:
    inspection = session.inspection
    had_place = inspection.pixel is not None or inspection.block is not None
    inspection.pixel = inspection.block = None
    return had_place


def _forget_highlight(session: Session) -> bool:
    inspection = session.inspection
    highlighted = inspection.selected_texture is not None or inspection.errors.highlighted_decoder is not None
    inspection.selected_texture = None
    inspection.errors = replace(inspection.errors, highlighted_decoder=None)
    return highlighted


@command(
    "window.dismiss", "Close what is on top", "close the topmost list, sheet or highlight; never the window", "Escape"
)
def dismiss(session: Session) -> Effect | None:
    closed = any(_close(session, layer) for layer in LAYERS) or _forget_places(session) or _forget_highlight(session)
    return None if closed else CancelOpening()
