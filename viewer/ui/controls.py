"""Widgets that run commands."""

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from viewer.commands import find_command
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import combo


def explained(text: str, reason: str) -> str:
    """Return a tooltip: the explanation, and the reason why the widget is grey."""
    return "\n".join(part for part in (text, f"Not now: {reason}" if reason else "") if part)


def command_button(
    ui: UiFrame,
    title: str,
    command_id: str,
    *values: object,
    label: str = "",
    missing: str = "",
    size: ImVec2 | None = None,
    small: bool = False,
) -> None:
    """Draw a button that runs a command with `values`; it is grey, with the reason as tooltip, while the command cannot run.

    `label` names it for scripts and tooltips, where that is not its title. `missing` says what else is missing to run it.
    """
    reason, label = missing or ui.why_not(command_id), label or title
    imgui.begin_disabled(bool(reason))
    clicked = imgui.small_button(title) if small else imgui.button(title, size or ImVec2(0, 0))
    imgui.end_disabled()
    ui.rects.note(label, explained(ui.rects.explanation(label), reason) if reason else "")
    if clicked and not reason:
        ui.emit(command_id, *values)


def copy_button(ui: UiFrame, title: str, label: str, text: Callable[[], str]) -> None:
    """Draw a button that copies a text to the clipboard."""
    if imgui.small_button(title):
        imgui.set_clipboard_text(text())
    ui.rects.note(label)


def check_box(ui: UiFrame, title: str, is_on: bool, command_id: str, label: str = "") -> None:
    """Draw a check box that runs a command: with the new state, or one that switches by itself."""
    changed, state = imgui.checkbox(title, is_on)
    ui.rects.note(label or title)
    if changed:
        ui.emit(command_id, *((state,) if find_command(command_id).parameters else ()))


def command_list(
    ui: UiFrame,
    label: str,
    current: str,
    choices: tuple[str, ...],
    command_id: str,
    *values: object,
    width: float = -1.0,
    refusal: Callable[[str], str] = lambda _choice: "",
    shown: Callable[[str], str] = str,
) -> None:
    """Draw a drop-down list that runs a command with `values` and the chosen text; `refusal` says why a choice is grey, `shown` gives
    its text in the opened list."""
    imgui.set_next_item_width(width)
    chosen = combo(label, current, choices, ui.rects, refusal, shown)
    if chosen != current:
        ui.emit(command_id, *values, chosen)


def slider(
    ui: UiFrame, label: str, value: float, ends: tuple[float, float], text: str, logarithmic: bool = False
) -> float | None:
    """Draw a slider over the rest of the row, and return its new value in steps of 0.001; None where it was not moved."""
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if logarithmic else 0)
    imgui.set_next_item_width(-1)
    moved, found = imgui.slider_float(f"##{label}", value, *ends, text, flags)
    ui.rects.note(label)
    return round(found, 3) if moved else None


def select_texture(ui: UiFrame, texture: int) -> None:
    """Select the texture whose row was clicked in all panels; a double-click opens its flat view."""
    doubly = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
    ui.emit("texture.flat" if doubly else "texture.select", str(texture))
