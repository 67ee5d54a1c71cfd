"""Commands: which panels there are, where they stand, and how they look."""

from dataclasses import replace

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.session import Session
from viewer.state.settings import UI_SCALE_RANGE, Theme


def _open_for_comparison(session: Session, title: str, is_open: bool) -> None:
    """Some panels stay closed until they are asked for."""
    comparing = session.comparing
    if title == "Pixel":
        session.comparing = replace(comparing, pixel=is_open)
    elif title == "Errors":
        session.comparing = replace(comparing, errors=is_open)
    elif title == "Histogram":
        session.comparing = replace(comparing, histogram=is_open)


def _reset_layout(session: Session) -> None:
    session.settings = replace(session.settings, hidden_panels=())
    session.show_panels = True
    session.layout_reset_requested = True


def _theme(session: Session, theme: Theme) -> None:
    session.settings = replace(session.settings, theme=theme)


def _ui_scale(session: Session, scale: float) -> None:
    low, high = UI_SCALE_RANGE
    if not low <= scale <= high:
        raise InputError(f"window.ui-scale: {scale:g} must be {low:g} to {high:g}")
    session.settings = replace(session.settings, ui_scale=scale)


def _panel(session: Session, title: str, state: str) -> None:
    hidden = tuple(name for name in session.settings.hidden_panels if name != title)
    session.settings = replace(session.settings, hidden_panels=hidden if state == "on" else (*hidden, title))
    _open_for_comparison(session, title, state == "on")
    if state == "on":
        session.show_panels = True
        session.raised_panel = title


THEME = Parameter("theme", "choice", "colours of the panels", fixed("dark", "light"))
SCALE = Parameter("scale", "number", "size of text and widgets, 1 is the normal one")
TITLE = Parameter("name", "choice", "title of the panel", lambda session: session.panel_titles)
STATE = Parameter("state", "choice", "on or off", fixed("on", "off"), default="on")
COMMANDS = (
    Command("window.layout-reset", "Reset layout", "put all panels where they stood at first", "Window", _reset_layout),
    Command("window.theme", "Theme", "dark or light panels", "Window", _theme, (THEME,)),
    Command("window.ui-scale", "UI scale", "size of text and widgets", "Window", _ui_scale, (SCALE,)),
    Command("window.panel", "Panel", "bring a panel to the front, or close it", "Window", _panel, (TITLE, STATE)),
)
