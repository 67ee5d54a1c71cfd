"""Question over the window, which must be answered before anything else."""

from imgui_bundle import imgui

from viewer.state.session import Question
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import place_dialog

WIDTH = 35.0
"""Width in font sizes."""


class QuestionWindow:
    """Window of the question, with the question that is shown."""

    def __init__(self) -> None:
        self._shown: Question | None = None

    def draw(self, ui: UiFrame, size: tuple[float, float]) -> None:
        """Draw the question, if there is one, in the middle of a window of `size`."""
        question = ui.session.window.question
        title = f"{question.title}###question" if question is not None else "###question"
        is_new, self._shown = question is not self._shown, question
        if question is not None and (is_new or not imgui.is_popup_open("###question")):
            imgui.open_popup("###question")
        place_dialog(size, WIDTH)
        flags = imgui.WindowFlags_
        if not imgui.begin_popup_modal(title, None, flags.no_move | flags.no_resize | flags.no_saved_settings)[0]:
            return
        if question is None:
            imgui.close_current_popup()
        else:
            self._content(question, is_new, ui)
        imgui.end_popup()

    @staticmethod
    def _content(question: Question, is_new: bool, ui: UiFrame) -> None:
        imgui.text_wrapped(question.text)
        imgui.spacing()
        chosen = None
        for index, choice in enumerate(question.choices):
            if index:
                imgui.same_line()
            if imgui.button(choice.label):
                chosen = choice.label
            ui.rects.note(choice.label, ui.rects.explanation(f"question {choice.label}"))
            if is_new and index == 0:
                imgui.set_item_default_focus()
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            chosen = question.choices[-1].label
        elif imgui.is_key_pressed(imgui.Key.enter, repeat=False) and not is_new:
            chosen = question.choices[0].label
        if chosen is not None:
            imgui.close_current_popup()
            ui.emit("question.answer", chosen)
