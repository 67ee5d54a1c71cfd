"""Section of the panel Compare: A against B, live, and how their difference and their turns look."""

import math
from typing import get_args

from imgui_bundle import imgui

from viewer.inspect.comparison import LiveFigures
from viewer.state.session import Session
from viewer.state.settings import FLICKER_RANGE
from viewer.state.view_state import DifferenceKind
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.widgets import WidgetRects, combo

GAINS = (1.0, 64.0)
"""Ends of the slider."""


def decibels(value: float | None) -> str:
    """A PSNR as text."""
    if value is None:
        return "-"
    return f"{value:.2f}" if math.isfinite(value) else "equal"


def figures_state(live: LiveFigures, session: Session, is_training: bool) -> str:
    """Which picture the figures are of, or why there are none."""
    if session.view.slot_a == session.view.slot_b:
        return "A and B show the same"
    if not session.settings.live_figures:
        return "switched off"
    if live.computing:
        return "computing"
    if is_training:
        return "not while training"
    if live.comparison is None:
        return live.problem or "when the picture rests"
    return "of this view" if live.is_current else "of an earlier view"


def draw_flicker(session: Session, emit: Emit, items: WidgetRects) -> None:
    """A and B in turns, and how often."""
    if imgui.checkbox("flicker", session.window.flickers)[0]:
        emit("compare.toggle-flicker")
    items.note("flicker")
    imgui.same_line()
    imgui.set_next_item_width(-1)
    low, high = FLICKER_RANGE
    rate = session.settings.flicker_hz
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    moved, rate = imgui.slider_float("##rate", rate, low, high, "%.1f Hz", flags)
    items.note("flicker rate")
    if moved:
        emit("compare.flicker", round(rate, 3))


def draw_difference(session: Session, emit: Emit, items: WidgetRects) -> None:
    """Which difference, and how much of it."""
    difference = session.view.difference
    imgui.set_next_item_width(110)
    kind = combo("difference", difference.kind, get_args(DifferenceKind), items)
    if kind != difference.kind:
        emit("compare.difference", kind)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    if difference.kind == "amplified":
        flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
        moved, gain = imgui.slider_float("##gain", difference.gain, *GAINS, "x %.1f", flags)
        items.note("gain")
        if moved:
            emit("compare.gain", round(gain, 3))
        return
    texts = {"raw": "|A - B|, sRGB", "relative": "|A - B| / A, linear", "flip": "dark 0, bright 1"}
    imgui.text_disabled(texts[difference.kind])


def draw_live_figures(session: Session, facts: FrameFacts, emit: Emit, items: WidgetRects) -> None:
    """PSNR, SSIM and FLIP of A against B."""
    changed, live_figures = imgui.checkbox("A against B", session.settings.live_figures)
    items.note("live figures")
    if changed:
        emit("compare.live", live_figures)
    imgui.same_line()
    imgui.text_disabled(figures_state(facts.live, session, facts.is_training))
    items.note("figures state")
    live = facts.live
    found = live.comparison
    texts = (
        ("PSNR", f"{decibels(found.psnr_db)} dB" if found and found.psnr_db is not None else "-"),
        ("SSIM", f"{found.ssim:.4f}" if found and found.ssim is not None else "-"),
        ("FLIP", f"{found.flip:.4f}" if found and found.flip is not None else "-"),
    )
    if imgui.begin_table("live figures", 2 * len(texts)):
        imgui.table_next_row()
        for name, text in texts:
            imgui.table_next_column()
            imgui.text_disabled(name)
            imgui.table_next_column()
            if live.is_current:
                imgui.text(text)
            else:
                imgui.text_disabled(text)
        imgui.end_table()
    items.note("live table")
    if found is not None and found.problem:
        imgui.text_wrapped(found.problem)
