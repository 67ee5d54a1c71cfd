"""The bar of menus, made from the registry of commands."""

from collections import defaultdict
from typing import get_args

from imgui_bundle import imgui

from viewer.commands import COMMANDS, bindings
from viewer.commands.command import Command, Menu
from viewer.commands.keys import Bindings
from viewer.ui.facts import UiFrame

LABEL = "menu: "
"""Before the names under which scripts click on menus and their items: `menu: View`, `menu: compare.mode a`."""


def draw_menu_bar(ui: UiFrame) -> float:
    """The bar at the upper edge; its height in window units."""
    commands: defaultdict[Menu | None, list[Command]] = defaultdict(list)
    for command in COMMANDS:
        commands[command.menu].append(command)
    if not imgui.begin_main_menu_bar():
        return 0.0
    bound = bindings(ui.session.settings.keys)
    # Opaque: menus hang over panels, whose text would shine through.
    ground = imgui.get_style_color_vec4(imgui.Col_.popup_bg)
    imgui.push_style_color(imgui.Col_.popup_bg, imgui.ImVec4(ground.x, ground.y, ground.z, 1.0))
    height = imgui.get_window_size().y
    for menu in get_args(Menu):
        if not commands[menu]:
            continue
        opened = imgui.begin_menu(menu)
        ui.rects.note(f"{LABEL}{menu}")
        if opened:
            for command in commands[menu]:
                _command(command, bound, ui)
            if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
                imgui.close_current_popup()
            imgui.end_menu()
    imgui.pop_style_color()
    imgui.end_main_menu_bar()
    return float(height)


def _command(command: Command, bound: Bindings, ui: UiFrame) -> None:
    """One entry: a submenu of choices, an item that runs the command, or one that opens the palette for its arguments."""
    if command.needs_arguments and all(parameter.is_choice for parameter in command.parameters):
        _choices(command, (), ui)
        return
    asks = command.needs_arguments
    clicked = imgui.menu_item_simple(f"{command.title}{'...' if asks else ''}", bound.text(command.id))
    ui.rects.note(f"{LABEL}{command.id}")
    imgui.set_item_tooltip(command.help)
    if clicked and asks:
        ui.emit("palette.set", command.id)
    elif clicked:
        ui.emit(command.id)


def _choices(command: Command, chosen: tuple[str, ...], ui: UiFrame) -> None:
    """A submenu for the parameter after those that are chosen."""
    options = command.parameters[len(chosen)].options(ui.session)
    name = " ".join((command.id, *chosen))
    opened = imgui.begin_menu(f"{chosen[-1] if chosen else command.title}##{name}", bool(options))
    ui.rects.note(f"{LABEL}{name}")
    if not opened:
        return
    is_last = len(chosen) == len(command.parameters) - 1
    for option in options:
        if not is_last:
            _choices(command, (*chosen, option), ui)
            continue
        if imgui.menu_item_simple(f"{option}##{name}"):
            ui.emit(command.id, *command.parse((*chosen, option)))
        ui.rects.note(f"{LABEL}{name} {option}")
    imgui.end_menu()
