"""Widgets of commands. Kind, tooltip, greying with its reason and effect all follow from the command's definition."""

from collections.abc import Callable
from typing import Any

from imgui_bundle import ImVec2, imgui

from viewer.commands import BY_ID, bindings
from viewer.commands.command import Arg, Parameter, typed
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import choice_text, command_text, control_text
from viewer.ui.theme import with_icon
from viewer.ui.widgets import beside, box_width, combo, list_width


def explained(text: str, reason: str) -> str:
    """Return a tooltip: the explanation, and the reason why the widget is grey."""
    return "\n".join(part for part in (text, f"Not now: {reason}" if reason else "") if part)


def control(
    ui: UiFrame,
    command_id: str,
    *chosen: Any,
    label: str = "",
    title: str = "",
    width: float | None = None,
    names: Callable[[Any], str] | None = None,
    shown: Callable[[str], str] | None = None,
) -> None:
    """Draw a check box, a list or a slider for one parameter of a command, after parameters with the values `chosen`.

    `label` names the widget for scripts; the default is the side and the verb of the command. A check box shows `title`, else the
    label. A list is as wide as its widest text unless `width` is given. `names` returns the text of a value, `shown` its text in the
    opened list.
    """
    command = BY_ID[command_id]
    label = label or " ".join((*map(str.upper, chosen), command_id.partition(".")[2].replace("-", " ")))
    assert command.current is not None
    value, reason = command.current(ui.session, *chosen), ui.why_not(command_id)
    parameter = command.parameters[len(chosen)] if command.parameters else None
    tip = explained(control_text(command, parameter, bindings(ui.session.settings.keys)), reason)
    imgui.begin_disabled(bool(reason))
    if parameter is None or command.is_switch:
        changed, value = imgui.checkbox(with_icon(command.icon, title or label), value)
        ui.rects.note(label, tip)
    else:
        imgui.set_next_item_width(-1.0 if width is None else width)
        if parameter.is_choice or parameter.arg.offers:
            current, value = value, _list(ui, label, parameter, value, tip, width is None, names, shown)
            changed = value != current
        else:
            changed, value = _slider(ui, label, parameter.arg, value, tip)
    imgui.end_disabled()
    if changed:
        ui.emit(command_id, *chosen, *((value,) if command.parameters else ()))


def _list(
    ui: UiFrame,
    label: str,
    parameter: Parameter,
    value: Any,
    tip: str,
    fits: bool,
    names: Callable[[Any], str] | None,
    shown: Callable[[str], str] | None,
) -> Any:
    """Draw a list and return the chosen value. With `fits` it is as wide as its widest text."""

    def name(text: str) -> str:
        return parameter.arg.names.get(text, text) if names is None else names(parameter.parse(text))

    choices = parameter.options(ui.session) or tuple(map(typed, parameter.arg.offers))
    if fits:
        imgui.set_next_item_width(list_width(*map(name, choices)))
    chosen = combo(
        *(label, typed(value), choices, ui.rects, tip, lambda text: parameter.refusal(ui.session, text), shown, name),
        lambda text: choice_text(parameter, text),
    )
    return parameter.parse(chosen) if chosen != typed(value) else value


def _slider(ui: UiFrame, label: str, arg: Arg, value: float, tip: str) -> tuple[bool, float]:
    low, high = arg.ends or (arg.minimum or 0.0, arg.maximum or 1.0)
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if arg.logarithmic else 0)
    moved, changed = imgui.slider_float(f"##{label}", value, low, high, arg.text, flags)
    ui.rects.note(label, tip)
    return moved, round(changed, 3)


def radio_buttons(ui: UiFrame, command_id: str) -> None:
    """Draw a radio button for each choice of a command."""
    command = BY_ID[command_id]
    parameter = command.parameters[0]
    assert command.current is not None
    for number, option in enumerate(parameter.options(ui.session)):
        name = parameter.arg.names.get(option, option)
        if number:
            beside(box_width(name))
        if imgui.radio_button(name, command.current(ui.session) == option):
            ui.emit(command_id, option)
        ui.rects.note(name, choice_text(parameter, option))


def command_button(
    ui: UiFrame,
    title: str,
    command_id: str,
    *values: object,
    label: str = "",
    tip: str = "",
    missing: str = "",
    size: ImVec2 | None = None,
    small: bool = False,
    icon: str = "",
) -> None:
    """Draw a button that runs a command with `values`. It is grey, with the reason in its tooltip, while the command cannot run.

    `label` names the button for scripts; the default is its title. `tip` replaces the command's help as tooltip, `icon` its icon.
    `missing` is a further reason why it cannot run; "" for none.
    """
    reason, label = missing or ui.why_not(command_id), label or title
    title = with_icon(icon or BY_ID[command_id].icon, title)
    imgui.begin_disabled(bool(reason))
    clicked = imgui.small_button(title) if small else imgui.button(title, size or ImVec2(0, 0))
    imgui.end_disabled()
    text = command_text(BY_ID[command_id], bindings(ui.session.settings.keys), tip)
    ui.rects.note(label, explained(text, reason))
    if clicked and not reason:
        ui.emit(command_id, *values)


def copy_button(ui: UiFrame, title: str, label: str, tip: str, text: Callable[[], str]) -> None:
    """Draw a button that copies a text to the clipboard."""
    if imgui.small_button(title):
        imgui.set_clipboard_text(text())
    ui.rects.note(label, tip)


def select_texture(ui: UiFrame, texture: int) -> None:
    """Select the texture of a clicked row in all panels; after a double-click, open its flat view."""
    doubly = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
    ui.emit("texture.flat" if doubly else "texture.select", str(texture))
