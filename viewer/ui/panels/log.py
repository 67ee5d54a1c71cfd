"""Panel "Log": all messages with their times; errors with details that can be copied."""

from imgui_bundle import ImVec2, imgui

from viewer.state.message_log import LogEntry
from viewer.ui.controls import copy_button
from viewer.ui.facts import UiFrame
from viewer.ui.theme import ERROR_ICON, ink, with_icon
from viewer.ui.widgets import counted, wrapped


class LogPanel:
    """Panel Log, with its filter and the expanded message."""

    def __init__(self) -> None:
        self._expanded: int | None = None
        self._errors_only = False
        self._count = 0

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        log = ui.session.window.log
        copy_button(ui, "copy all", "copy log", "Copy all messages to the clipboard.", log.text)
        imgui.same_line()
        _, self._errors_only = imgui.checkbox("errors only", self._errors_only)
        ui.rects.note("errors only", "Show only errors.")
        imgui.same_line()
        imgui.text_disabled(counted(len(log), "message"))
        if imgui.begin_child("lines"):
            color = ink("error")
            for entry in log:
                if entry.kind == "error" or not self._errors_only:
                    self._line(entry, color, ui)
            if log.count != self._count:
                self._count = log.count
                imgui.set_scroll_here_y(1.0)
        imgui.end_child()

    def _line(self, entry: LogEntry, color: imgui.ImVec4, ui: UiFrame) -> None:
        more = "+ " if entry.details and self._expanded != entry.number else ""
        text = with_icon(ERROR_ICON if entry.kind == "error" else "", f"{more}{entry.line()}")
        at, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
        height = imgui.calc_text_size(text, wrap_width=width).y
        chosen = imgui.selectable(f"##{entry.number}", self._expanded == entry.number, size=ImVec2(0, height))[0]
        ui.rects.note(
            f"log {entry.number}", "A message with its time. A click shows the details of a line that begins with +."
        )
        if imgui.is_item_visible():
            imgui.set_cursor_pos(at)
            wrapped(text, color if entry.kind == "error" else imgui.get_style().color_(imgui.Col_.text))
        if chosen:
            self._expanded = None if self._expanded == entry.number else entry.number
        if self._expanded != entry.number:
            return
        imgui.indent()
        copy_button(
            ui,
            f"copy##{entry.number}",
            f"copy log {entry.number}",
            "Copy this message with its details to the clipboard.",
            entry.whole,
        )
        imgui.text_wrapped(entry.details or entry.text)
        imgui.unindent()
