"""Card of first steps: the purpose of the program, and three things to try."""

from dataclasses import replace

from imgui_bundle import imgui

from viewer.commands import bindings
from viewer.commands.keys import HOLD_KEY
from viewer.state.session import Session
from viewer.ui.facts import UiFrame
from viewer.ui.theme import ink, with_icon
from viewer.ui.widgets import Area, card, card_room, disabled_beside, em, grid

WIDTH = 20.0
"""Largest width of the card in font sizes."""
LEAST_REST = 26.0
"""Least width beside the card for the offer, a legend and messages, in font sizes. With less, the card is wide and low."""
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
    """Card of first steps. It marks finished steps."""

    def __init__(self) -> None:
        self._done = [False, False, False]
        self._scene: str | None = None

    def draw(self, ui: UiFrame, area: Area) -> Area:
        """Draw the card at the lower left of `area`. Returns the area right of it, or above it where that is too narrow."""
        if not ui.session.window.show_first_steps:
            return area
        self._note_progress(ui.session)
        width = min(em(WIDTH), area.width - grid(6))
        beside = replace(area, left=area.left + grid(3) + width)
        is_low = beside.width < em(LEAST_REST)
        room = card_room(ui.rects, area, max(area.width - grid(6), em(8.0)) if is_low else width, on_right=False)
        if room is None:
            return area
        with card("##first steps", room, at_bottom=True):
            imgui.text_wrapped(PURPOSE)
            imgui.separator()
            for number, ((do, why), done) in enumerate(zip(_steps(ui.session), self._done, strict=True), 1):
                self._row(f"{number}. {do}", why, done)
                ui.rects.note(f"first step {number}", "One of three things to try in the first minute.")
            if imgui.button("Got it"):
                ui.emit("window.close-layer", "window.show_first_steps")
            ui.rects.note("Got it", "Close the card for good; Help > First steps shows it again.")
            imgui.same_line()
            imgui.text_disabled("Help > First steps shows this again.")
            top = imgui.get_window_pos().y
        return replace(area, bottom=top) if is_low else beside

    @staticmethod
    def _row(do: str, why: str, done: bool) -> None:
        imgui.begin_group()
        if done:
            imgui.text_colored(ink("good"), with_icon("check", f"{do}: done"))
        else:
            imgui.text(do)
        disabled_beside(why)
        imgui.end_group()

    def _note_progress(self, session: Session) -> None:
        self._scene = self._scene or session.scene_key
        tried = (session.window.show_other, session.view.overlay.kind == "divergence", session.scene_key != self._scene)
        self._done = [before or now for before, now in zip(self._done, tried, strict=True)]
