"""The sheet of keys and mouse, with a field to search it."""

from imgui_bundle import ImVec2, imgui

from viewer.commands import bindings, key_table
from viewer.ui.facts import UiFrame

WIDTH = 640.0


class KeySheet:
    """Remembers what is searched for."""

    def __init__(self) -> None:
        self._text = ""
        self._was_open = False
        self._typing = False

    def draw(self, ui: UiFrame, size: tuple[float, float], top: float) -> None:
        """The sheet, while the session has it open; below `top` in window units."""
        opening = ui.session.window.show_help and not self._was_open
        self._was_open = ui.session.window.show_help
        if not ui.session.window.show_help:
            self._typing = False
            return
        rows = [
            (key, description)
            for key, description in key_table(bindings(ui.session.settings.keys))
            if self._text.lower() in f"{key} {description}".lower()
        ]
        scale = imgui.get_font_size() / 13.0
        middle = ImVec2(size[0] / 2.0, (top + size[1]) / 2.0)
        imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(min(WIDTH * scale, size[0] - 16.0), min(800.0 * scale, size[1] - top - 16.0)))
        imgui.set_next_window_bg_alpha(1.0)
        flags = imgui.WindowFlags_
        if opening:
            self._text = ""
            imgui.set_next_window_focus()
        opened, stays = imgui.begin(
            "Keys and mouse", True, flags.no_collapse | flags.no_saved_settings | flags.no_docking | flags.no_resize
        )
        if opened:
            self._search(opening, ui)
            if imgui.begin_table("keys", 2, imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg):
                imgui.table_setup_column("key", imgui.TableColumnFlags_.width_fixed)
                imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch)
                for key, description in rows:
                    imgui.table_next_row()
                    imgui.table_next_column()
                    imgui.text(key)
                    imgui.table_next_column()
                    imgui.text_wrapped(description)
                imgui.end_table()
            ui.rects.note("help")
        imgui.end()
        # The field owns the key in the frame in which it ends the typing.
        if not stays or (self._typing and imgui.is_key_pressed(imgui.Key.escape, repeat=False)):
            ui.emit("help.close")

    def _search(self, opening: bool, ui: UiFrame) -> None:
        imgui.set_next_item_width(-170.0)
        if opening:
            imgui.set_keyboard_focus_here()
        _, self._text = imgui.input_text_with_hint("##search", "search", self._text)
        self._typing = imgui.is_item_active() or imgui.is_item_deactivated()
        ui.rects.note("search keys")
        imgui.same_line()
        imgui.text_disabled("F1 closes this")
