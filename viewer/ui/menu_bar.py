"""Menu bar, made from the registry of commands."""

from imgui_bundle import imgui

from viewer.commands import bindings
from viewer.commands.command import Command, typed
from viewer.commands.keys import Bindings
from viewer.commands.menus import MENUS
from viewer.ui.controls import explained
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES, choice_text, command_text
from viewer.ui.theme import icon

LABEL = "menu: "
"""Prefix of the labels of menus and their items: `menu: View`, `menu: compare.mode a`."""


def draw_menu_bar(ui: UiFrame) -> float:
    """Draw the menu bar at the upper edge, and return its height in window units."""
    if not imgui.begin_main_menu_bar():
        return 0.0
    bound = bindings(ui.session.settings.keys)
    # Menus are opaque; otherwise the text of panels would shine through.
    ground = imgui.get_style_color_vec4(imgui.Col_.popup_bg)
    imgui.push_style_color(imgui.Col_.popup_bg, imgui.ImVec4(ground.x, ground.y, ground.z, 1.0))
    height = imgui.get_window_size().y
    for menu, sections in MENUS.items():
        opened = imgui.begin_menu(menu)
        ui.rects.note(f"{LABEL}{menu}", FIGURES[f"{LABEL}{menu}"], opened)
        if opened:
            for number, section in enumerate(sections):
                if number:
                    imgui.separator()
                for command in section:
                    _command(command, bound, ui)
            if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
                imgui.close_current_popup()
            imgui.end_menu()
    imgui.pop_style_color()
    imgui.end_main_menu_bar()
    return float(height)


def _command(command: Command, bound: Bindings, ui: UiFrame) -> None:
    """Draw the item of a command: one that runs or switches it, a submenu of choices, or one that opens the palette for arguments."""
    reason = ui.why_not(command.id)
    note = explained(command_text(command, bound), reason)
    if command.is_switch:
        is_on = command.is_on(ui.session)
        if _item(ui, command.title, command.id, note, is_on, not reason, bound.text(command.id), command.icon):
            ui.emit(command.id, *([not is_on] if command.parameters else ()))
        return
    needed = [parameter for parameter in command.parameters if parameter.default_text is None]
    if needed and all(parameter.is_choice for parameter in needed) and not reason:
        _choices(command, len(needed), (), note, ui)
        return
    title = f"{command.title}..." if needed else command.title
    if _item(ui, title, command.id, note, False, not reason, bound.text(command.id), command.icon):
        ui.emit(*(("palette.set", command.id) if needed else (command.id,)))


def _item(
    ui: UiFrame, title: str, name: str, note: str, is_on: bool, enabled: bool, key: str = "", sign: str = ""
) -> bool:
    """Draw an item with icon and tooltip, and return whether it was clicked."""
    clicked = imgui.internal.menu_item_ex(title, icon(sign), key, is_on, enabled)
    ui.rects.note(f"{LABEL}{name}", note)
    return clicked


def _choices(command: Command, needed: int, chosen: tuple[str, ...], note: str, ui: UiFrame) -> None:
    """Draw a submenu of choices for the next parameter; `chosen` are the arguments so far, of `needed` in all."""
    parameter = command.parameters[len(chosen)]
    options = parameter.options(ui.session)
    name = " ".join((command.id, *chosen))
    title = command.parameters[len(chosen) - 1].arg.names.get(chosen[-1], chosen[-1]) if chosen else command.title
    sign = "" if chosen else icon(command.icon)
    opened = imgui.internal.begin_menu_ex(f"{title}##{name}", sign, bool(options))
    ui.rects.note(f"{LABEL}{name}", note if options else explained(note, "there are none yet"), opened)
    if not opened:
        return
    is_last = len(chosen) == needed - 1
    current = typed(command.current(ui.session, *chosen)) if is_last and command.current is not None else None
    for option in options:
        if not is_last:
            _choices(command, needed, (*chosen, option), note, ui)
            continue
        refusal = parameter.refusal(ui.session, option)
        about = explained(choice_text(parameter, option), refusal)
        title = f"{parameter.arg.names.get(option, option)}##{name}"
        if _item(ui, title, f"{name} {option}", about, option == current, not refusal):
            ui.emit(command.id, *command.parse((*chosen, option)))
    imgui.end_menu()
