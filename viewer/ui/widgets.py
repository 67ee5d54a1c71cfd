"""Widgets that several panels share."""

from imgui_bundle import imgui

from viewer.ui.items import ItemPlaces


def combo(label: str, current: str, choices: tuple[str, ...], items: ItemPlaces) -> str:
    """A drop-down list; the chosen text."""
    chosen = current
    opened = imgui.begin_combo(f"##{label}", current)
    items.note(label)
    if opened:
        for choice in choices:
            if imgui.selectable(choice, choice == current)[0]:
                chosen = choice
            items.note(f"{label}: {choice}")
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            imgui.close_current_popup()
        imgui.end_combo()
    return chosen


def counted(number: int, noun: str) -> str:
    """`1 texture`, `2 textures`."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
