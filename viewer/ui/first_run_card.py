"""The card of first steps: what this program is for, and three things to try."""

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from viewer.commands import bindings
from viewer.commands.keys import HOLD_KEY
from viewer.state.session import Session
from viewer.ui.facts import UiFrame
from viewer.ui.theme import ink, with_icon
from viewer.ui.widgets import CARD_FLAGS, Area, grid, wrapped_disabled

WIDTH = 26.0
"""Largest width of the card in font sizes."""
LEAST_REST = 22.0
"""Least width beside the card for a legend and messages, in font sizes."""
PURPOSE = (
    "ntc-viewer shows a scene whose textures are stored by small neural networks, "
    "beside the original, with the error and the cost of every pixel."
)


def _steps(session: Session) -> tuple[tuple[str, str], ...]:
    """Return (action, result that the user sees) of each step."""
    bound = bindings(session.settings.keys)
    overlay, opening = bound.text("overlay.toggle") or "the menu Overlay", bound.text("file.open") or "File > Open"
    return (
        (f"Hold {HOLD_KEY}", "A and B swap: watch the differences."),
        (f"Press {overlay}", "A map shows blocks of pixels that need more than one decoder."),
        ("Drop your glTF on the window", f"Or press {opening}. Then encode it."),
    )


class FirstRunCard:
    """Card of first steps, which marks the steps that were done."""

    def __init__(self) -> None:
        self._done = [False, False, False]
        self._scene: str | None = None

    def draw(self, ui: UiFrame, area: Area) -> Area:
        """Draw the card at the lower left of `area`, and return the area right of it, or above it where that is too narrow."""
        if not ui.session.window.show_first_steps:
            return area
        self._note_progress(ui.session)
        font = imgui.get_font_size()
        width = min(WIDTH * font, area.width - grid(6))
        low = ImVec2(area.left + grid(3), area.bottom - 3.0 * font)
        imgui.set_next_window_pos(low, imgui.Cond_.always, ImVec2(0.0, 1.0))
        imgui.set_next_window_size(ImVec2(max(width, 8.0 * font), 0.0))
        imgui.set_next_window_bg_alpha(0.95)
        imgui.begin("##first steps", None, CARD_FLAGS)
        imgui.text_wrapped(PURPOSE)
        imgui.separator()
        for number, ((do, why), done) in enumerate(zip(_steps(ui.session), self._done, strict=True), 1):
            self._row(f"{number}. {do}", why, done)
            ui.rects.note(f"first step {number}")
        if imgui.button("Got it"):
            ui.emit("window.close-layer", "window.show_first_steps")
        ui.rects.note("Got it")
        imgui.same_line()
        imgui.text_disabled("Help > First steps shows this again.")
        top = imgui.get_window_pos().y
        imgui.end()
        rest = replace(area, left=area.left + grid(3) + width)
        return rest if rest.width >= LEAST_REST * font else replace(area, bottom=max(top, area.top + 1.0))

    @staticmethod
    def _row(do: str, why: str, done: bool) -> None:
        imgui.begin_group()
        if done:
            imgui.text_colored(ink("good"), with_icon("check", f"{do}: done"))
        else:
            imgui.text(do)
        imgui.indent()
        wrapped_disabled(why)
        imgui.unindent()
        imgui.end_group()

    def _note_progress(self, session: Session) -> None:
        self._scene = self._scene or session.scene_key
        tried = (session.window.show_other, session.view.overlay.kind == "divergence", session.scene_key != self._scene)
        self._done = [before or now for before, now in zip(self._done, tried, strict=True)]
