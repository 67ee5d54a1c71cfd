"""Panel "Log": all messages with their times; errors with their details, to be copied."""

from imgui_bundle import imgui

from viewer.state.message_log import LogEntry
from viewer.ui.facts import UiFrame

ERROR_DARK = (1.0, 0.45, 0.4, 1.0)
ERROR_LIGHT = (0.75, 0.1, 0.05, 1.0)


class LogPanel:
    """Remembers what is expanded."""

    def __init__(self) -> None:
        self._expanded: int | None = None
        self._errors_only = False
        self._count = 0

    def draw(self, ui: UiFrame) -> None:
        """The content of the panel."""
        log = ui.session.window.log
        if imgui.small_button("copy all"):
            imgui.set_clipboard_text(log.text())
        ui.rects.note("copy log")
        imgui.same_line()
        _, self._errors_only = imgui.checkbox("errors only", self._errors_only)
        ui.rects.note("errors only")
        imgui.same_line()
        imgui.text_disabled(f"{len(log):,} messages")
        if imgui.begin_child("lines"):
            color = imgui.ImVec4(*(ERROR_DARK if ui.session.settings.theme == "dark" else ERROR_LIGHT))
            if self._errors_only or self._expanded is not None:
                # Lines of several heights: a clipper takes equal ones.
                for entry in log:
                    if entry.kind == "error" or not self._errors_only:
                        self._line(entry, color, ui)
            else:
                clipper = imgui.ListClipper()
                clipper.begin(len(log))
                while clipper.step():
                    for index in range(clipper.display_start, clipper.display_end):
                        self._line(log[index], color, ui)
            if log.count != self._count:
                self._count = log.count
                imgui.set_scroll_here_y(1.0)
        imgui.end_child()

    def _line(self, entry: LogEntry, color: imgui.ImVec4, ui: UiFrame) -> None:
        is_error = entry.kind == "error"
        if is_error:
            imgui.push_style_color(imgui.Col_.text, color)
        more = "+ " if entry.details and self._expanded != entry.number else ""
        chosen = imgui.selectable(f"{more}{entry.line()}##{entry.number}", self._expanded == entry.number)[0]
        if is_error:
            imgui.pop_style_color()
        ui.rects.note(f"log {entry.number}")
        if chosen:
            self._expanded = None if self._expanded == entry.number else entry.number
        if self._expanded != entry.number:
            return
        imgui.indent()
        if imgui.small_button(f"copy##{entry.number}"):
            imgui.set_clipboard_text(entry.whole())
        ui.rects.note(f"copy log {entry.number}")
        # Long lines are cut by the panel's edge above.
        imgui.text_wrapped(entry.details or entry.text)
        imgui.unindent()
