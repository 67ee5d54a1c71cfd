"""Commands for the window, its panels, and their appearance."""

from dataclasses import replace
from typing import Annotated

from viewer.commands.command import Arg, Command, command, field_command, field_gesture, setter, unless
from viewer.commands.effects import Effect, RaisePanel, ResetLayout
from viewer.state.session import Session
from viewer.state.view_state import WHOLE

OPENED_ON_REQUEST = ("Pixel", "Errors", "Histogram", "Log")
"""Titles of the panels that are closed until the user opens them."""
State = Annotated[bool, Arg("on or off")]


show_whole_picture = command(
    "view.whole",
    "Whole picture",
    "show the whole picture again after magnifying",
    "Z",
    unavailable=unless(lambda context: context.session.view.zoom != WHOLE, "the whole picture is shown"),
)(setter("view.zoom", WHOLE))
resolution = field_command("resolution")
coarse_while_moving = field_command("settings.coarse_while_moving")
toggle_panels = field_command("window.show_panels")


def _fold_column(session: Session, folded: bool) -> None:
    session.window.column_folded = folded
    session.settings = replace(session.settings, column_folded=folded)


@command(
    "window.column",
    "Fold panels",
    "fold the panels into a strip at the edge of the window, or unfold them",
    "Shift+H",
    current=lambda session: session.window.column_folded,
)
def toggle_column(session: Session) -> None:
    _fold_column(session, session.window.show_panels and not session.window.column_folded)
    session.window.show_panels = True


fit_column = field_gesture("window.fit-column", "window.column_folded")


def panel_command(title: str, help_line: str, key: str = "", *, icon: str) -> Command:
    """Return the command that opens or closes a panel of OPENED_ON_REQUEST."""

    def toggle(session: Session) -> None:
        session.window.open_panels ^= {title}

    def is_open(session: Session) -> bool:
        return title in session.window.open_panels

    return command(f"{title.lower()}.panel", f"{title} panel", help_line, key, current=is_open, icon=icon)(toggle)


log_panel = panel_command("Log", "show all messages with their times", icon="receipt")


@command("help.palette", "Find a command", "find a command by typing", "Ctrl+P", "F3", icon="magnifying-glass")
def toggle_palette(session: Session) -> None:
    session.window.palette = None if session.window.palette is not None else ""


keys = field_command("window.show_help")


@command("window.layout-reset", "Reset layout", "dock all panels in their original places")
def reset_layout(session: Session) -> Effect:
    session.settings = replace(session.settings, hidden_panels=(), folded_panels=(), column_folded=None)
    session.window.show_panels = True
    return ResetLayout()


theme = field_command("settings.theme")
ui_scale = field_command("settings.ui_scale")


Title = Annotated[str, Arg("title of the panel", lambda session: session.window.panel_titles)]


@command("window.panel", "Show panel", "bring a panel to the front, or close it")
def show_panel(session: Session, name: Title, state: State = True) -> Effect | None:
    hidden = tuple(title for title in session.settings.hidden_panels if title != name)
    # Panels that open on request are closed, not hidden: check boxes and keys open them again.
    closed = state or name in OPENED_ON_REQUEST
    session.settings = replace(session.settings, hidden_panels=hidden if closed else (*hidden, name))
    others = session.window.open_panels - {name}
    session.window.open_panels = others | {name} if state and name in OPENED_ON_REQUEST else others
    if not state:
        return None
    session.window.show_panels = True
    if session.window.column_folded:
        _fold_column(session, False)
    return RaisePanel(name)


@command("window.stack", "Fold stack", "fold the stack with this panel to its tabs, or unfold it")
def fold_stack(session: Session, name: Title, state: Annotated[bool, Arg("on: unfolded, off: folded")] = True) -> None:
    others = tuple(title for title in session.settings.folded_panels if title != name)
    session.settings = replace(session.settings, folded_panels=others if state else (*others, name))


first_steps = field_command("window.show_first_steps")
glossary = field_command("window.show_glossary")
set_palette = field_gesture("palette.set", "window.palette")
