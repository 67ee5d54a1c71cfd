"""Status bar at the lower edge of the window: the last message, and background work."""

from collections.abc import Sequence

from imgui_bundle import ImVec2, imgui

from viewer.scene.json_text import duration, percent
from viewer.state.message_log import MessageLog
from viewer.ui.facts import UiFrame, Work
from viewer.ui.theme import ERROR_ICON, with_icon
from viewer.ui.widgets import grid, shortened, side_bar

SHARE_WIDTH, SHARE_HEIGHT = 22.0, 1.5
"""Size of the progress bar in units of the grid."""
MESSAGE_SHARE = 0.3
"""Least width of the last message beside the work, as a share of the bar."""
CANCEL = "Cancel"


def status_bar_height() -> float:
    """Return the height of the bar in window units: one line of text."""
    return float(imgui.get_text_line_height() + grid(2))


def draw_status_bar(ui: UiFrame) -> float:
    """Draw the bar, and return its height in window units. The viewport's work area is smaller by that from the next frame on."""
    height = status_bar_height()
    inset = (height - imgui.get_text_line_height()) / 2.0
    padding = ImVec2(imgui.get_style().window_padding.x, inset)
    with side_bar("##status", imgui.Dir.down, height, padding) as opened:
        if not opened:
            return height
        right = imgui.get_content_region_avail().x
        _message(ui.session.window.log, _work(ui.facts.work, right, ui) if ui.facts.work else right, ui)
    return height


def _message(log: MessageLog, width: float, ui: UiFrame) -> None:
    """Draw the last message, shortened to `width`. The tooltip has the whole message."""
    imgui.set_cursor_pos_x(imgui.get_style().window_padding.x)
    if not len(log):
        imgui.text("")
        ui.rects.note("status", "Work in the background, and the last message.")
        return
    last = log[-1]
    text = " ".join(last.text.split())
    shown = shortened(with_icon(ERROR_ICON, f"error: {text}") if last.kind == "error" else text, width)
    if last.kind == "error":
        imgui.text(shown)
    else:
        imgui.text_disabled(shown)
    ui.rects.note("status", last.line())


def work_text(work: Work) -> str:
    """Return a line about background work: `encoding bc7: 34 %, 12 s left`."""
    share = f": {percent(work.share)}" if work.share is not None else ""
    left = f", {duration(work.seconds_left)} left" if work.seconds_left is not None else ""
    return work.title + share + left


def _work(all_work: Sequence[Work], right: float, ui: UiFrame) -> float:
    """Draw the work at the right edge, where the button does not move. Returns the width left of it."""
    first, style = all_work[0], imgui.get_style()
    gap, left = style.item_spacing.x, style.window_padding.x + right
    button = imgui.calc_text_size(CANCEL).x + 2.0 * style.frame_padding.x
    left -= button
    imgui.set_cursor_pos_x(left)
    if first.cancel:
        if imgui.small_button(f"{CANCEL}##work"):
            ui.emit(first.cancel)
        ui.rects.note("cancel work", f"Cancel: {first.title}.")
        imgui.same_line()
    bar, thick = grid(SHARE_WIDTH), grid(SHARE_HEIGHT)
    top = imgui.get_cursor_pos_y()
    if first.share is not None:
        left -= gap + bar
        imgui.set_cursor_pos(ImVec2(left, top + (imgui.get_text_line_height() - thick) / 2.0))
        imgui.progress_bar(min(1.0, first.share), ImVec2(bar, thick), "")
        ui.rects.note("share of the work", work_text(first))
        imgui.same_line()
    more = f"  (+ {len(all_work) - 1})" if len(all_work) > 1 else ""
    message = MESSAGE_SHARE * right if len(ui.session.window.log) else 0.0
    text = shortened(work_text(first), left - 2.0 * gap - message - imgui.calc_text_size(more).x) + more
    left -= gap + imgui.calc_text_size(text).x
    imgui.set_cursor_pos(ImVec2(left, top))
    imgui.text(text)
    ui.rects.note("work", "\n".join(map(work_text, all_work)))
    imgui.same_line()
    return left - style.window_padding.x - 2.0 * gap
