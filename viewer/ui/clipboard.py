"""The clipboard of the window system, through ImGui."""

from imgui_bundle import imgui


class WindowClipboard:
    """Where copied text is; ImGui's own in a program without a window."""

    def read(self) -> str:
        """The text; "" for none."""
        return imgui.get_clipboard_text() or ""

    def write(self, text: str) -> None:
        """Replace it."""
        imgui.set_clipboard_text(text)
