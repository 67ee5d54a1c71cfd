"""Panel "Training": forms to encode, the current run with its curves, buttons to keep or discard it, and the log of runs."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui, implot
from numpy.typing import NDArray

from ntc.codec.registry import codec_named
from viewer.scene.json_text import duration, percent
from viewer.state.framing import emptiest
from viewer.state.pack_files import base_pack_name, pack_figures
from viewer.state.view_state import REFERENCE
from viewer.training.preparation import job_title
from viewer.training.run_figures import figures_of_run, figures_under_way, loss_ticks, psnr_ends, psnr_of_run
from viewer.training.run_log import ActiveRun, Curves, Run
from viewer.ui.controls import command_button
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.panels.encode_form import EncodeForm
from viewer.ui.panels.training_forms import TrainingForms
from viewer.ui.theme import INKS, ink
from viewer.ui.widgets import Area, branch, card, card_room, cells, combo, counted, em, grid, headings, shortened

PLOT_LINES = 8.5
"""Height of a plot in lines of text."""
FIT = implot.AxisFlags_.auto_fit
MOST_NAMED = 6
"""Most groups that the legend of the plot lists."""
WORST = "worst texture"


class TrainingCurves:
    """Plots of a training: loss by group, and PSNR of the mean and of one texture."""

    def __init__(self) -> None:
        self._texture: int | None = None
        """Texture whose PSNR is drawn; None for the worst one."""

    def draw(self, curves: Curves, names: Sequence[str], kind: str | None, ui: UiFrame) -> None:
        """Draw the plots. `names` are those of the pack's textures, `kind` is its codec or None where unknown."""
        if len(curves.seconds) < 2:
            imgui.text_disabled("Curves appear after the first steps.")
            return
        seconds = curves.array(curves.seconds)
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        size = ImVec2(imgui.get_content_region_avail().x, PLOT_LINES * imgui.get_text_line_height_with_spacing())
        codec = codec_named(kind) if kind is not None else None
        # A codec that does not train has no loss.
        if codec is None or codec.trains:
            self._losses(curves, seconds, size, flags, ui)
        texture = self._chosen(curves)
        if implot.begin_plot(
            f"{codec.psnr_title if codec is not None else 'PSNR'}##psnr", size, flags | implot.Flags_.no_legend
        ):
            implot.setup_axes("seconds", "dB")
            ends = psnr_ends(curves, texture)
            implot.setup_axes_limits(seconds[0], max(seconds[-1], seconds[0] + 0.1), *ends, implot.Cond_.always)
            # The text colour is readable on both themes.
            mean = implot.Spec(line_color=imgui.get_style_color_vec4(imgui.Col_.text), line_weight=3.0)
            implot.plot_line("mean", seconds, curves.array(curves.mean_db), mean)
            if texture is not None:
                spec = implot.Spec(line_color=ink("a"), line_weight=1.5)
                implot.plot_line(_name(texture, names), seconds, curves.array(curves.psnr_db[texture]), spec)
            implot.end_plot()
        ui.rects.note(
            "PSNR curve",
            "PSNR in dB over the training: the thick line is the mean of all textures, the blue one the chosen texture.",
        )
        imgui.text_wrapped(
            "thick line: mean" + (f"; blue line: {_name(texture, names)}" if texture is not None else "")
        )
        self._choose(curves, names, ui)

    @staticmethod
    def _losses(curves: Curves, seconds: NDArray[np.float64], size: ImVec2, flags: int, ui: UiFrame) -> None:
        unnamed = implot.Flags_.no_legend if len(curves.losses) > MOST_NAMED else 0
        if implot.begin_plot("loss by group##loss", size, flags | unnamed):
            implot.setup_axes("seconds", "loss", FIT, FIT)
            # The legend lies beside the plot, because inside it would hide curves.
            implot.setup_legend(implot.Location_.east, implot.LegendFlags_.outside)
            implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
            ticks = loss_ticks(curves)
            implot.setup_axis_ticks(implot.ImAxis_.y1, ticks, [f"{tick:.1g}" for tick in ticks])
            for group, curve in sorted(curves.losses.items()):
                implot.plot_line(f"{group}", seconds, curves.array(curve), implot.Spec(line_weight=1.5))
            implot.end_plot()
        ui.rects.note("loss by group", "Loss that training minimises, for each group: lower is better.")

    def _chosen(self, curves: Curves) -> int | None:
        if self._texture in curves.psnr_db:
            return self._texture
        now = {texture: curve[-1] for texture, curve in curves.psnr_db.items() if curve[-1] == curve[-1]}
        return min(now, key=lambda texture: now[texture]) if now else None

    def _choose(self, curves: Curves, names: Sequence[str], ui: UiFrame) -> None:
        choices = {WORST: None, **{_name(texture, names): texture for texture in sorted(curves.psnr_db)}}
        current = next((label for label, texture in choices.items() if texture == self._texture), WORST)
        imgui.set_next_item_width(-1)
        self._texture = choices[
            combo("curve of", current, tuple(choices), ui.rects, "Texture whose PSNR is drawn in blue.")
        ]


def _name(texture: int, names: Sequence[str]) -> str:
    return f"{texture} {names[texture]}" if texture < len(names) else str(texture)


CURVES = "Loss and PSNR over the last run."
SHOW_RUN = "Show the pack of this run in this slot."
SHOW_UNSAVED_RUN = "Show the pack of the last run of this scene that was neither saved nor discarded."
KEEP_RUN = "Write the pack of this run beside the scene; for a built-in scene into the user's data folder."
DISCARD_RUN = "Delete the pack of this run. Until the window closes, Keep still writes it."
RUN_COLUMNS = ("run", "what", "dB", "time", "into")
STATES = {
    "preparing": "preparing textures and groups",
    "training": "",
    "pausing": "pausing",
    "paused": "paused",
    "cancelling": "cancelling",
}


class TrainingPanel:
    """Panel Training of a window."""

    def __init__(self) -> None:
        self._forms = TrainingForms()
        self._curves = TrainingCurves()

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        run, log = ui.training.active, ui.training.log
        if run is not None or log.chosen is not None:
            self._run(run, None if run is not None else log[log.chosen or 0], ui)
        if run is not None:
            names = [texture.name for texture in run.request.textures] if run.request is not None else []
            self._curves.draw(run.curves, names, run.codec_kind, ui)
        else:
            if log.chosen is not None:
                imgui.separator()
            name = base_pack_name(ui.session.view, ui.session.packs)
            self._forms.draw(ui.session.packs[name] if name is not None else None, name or "", ui)
            if ui.training.curves is not None and len(ui.training.curves.seconds) > 1:
                with branch(ui.rects, "curves of the last run", "curves of the last run", CURVES) as opened:
                    pack = log.runs[-1].pack if log.runs and opened else None
                    names = [texture.name for texture in pack.textures] if pack is not None else []
                    kind = pack.config.kind if pack is not None else None
                    if opened:
                        self._curves.draw(ui.training.curves, names, kind, ui)
        if log.runs:
            imgui.separator()
            _log(ui)

    def _run(self, run: ActiveRun | None, ended: Run | None, ui: UiFrame) -> None:
        """Draw the current run, or an ended one until the user keeps or discards it.

        Lines and buttons above the figures are the same in all states, so that no button moves under the mouse when a run ends.
        """
        style = imgui.get_style()
        # Leave room for a scroll bar, which appears with the curves, so that buttons do not move.
        room = imgui.get_window_width() - 2.0 * style.window_padding.x - style.scrollbar_size
        name, title = (run.name, job_title(run.job)) if run is not None else ("", "")
        if ended is not None:
            name, title = ended.name, ended.title
        heading = f"{name}: {title}"
        imgui.text(shortened(heading, room))
        ui.rects.note("training run", heading)
        _progress(run, ui)
        imgui.text(shortened(_state(run, ended), room))
        ui.rects.note("training state", _state(run, ended))
        half = (room - style.item_spacing.x) / 2.0
        waits = run is not None and run.state in ("paused", "pausing")
        size, under_way = ImVec2(half, 0.0), "" if ended is not None else "the run has not ended"
        command_button(ui, "Resume" if waits else "Pause", f"training.{'resume' if waits else 'pause'}", size=size)
        imgui.same_line()
        cancelled = "it is being cancelled" if run is not None and run.state == "cancelling" else ""
        command_button(ui, "Cancel", "training.cancel", missing=cancelled, size=size)
        command_button(ui, "Keep", "training.keep", missing=under_way, size=size)
        imgui.same_line()
        command_button(ui, "Discard", "training.discard", missing=under_way, size=size)
        for line in figures_under_way(run) if run is not None else figures_of_run(ended) if ended is not None else ():
            imgui.text_wrapped(line)
            ui.rects.note(
                "training figure",
                "PSNR in dB of the mean square error: higher is better. Mip 0 is the largest mip; codec grid trains on "
                "samples of all mips, whose PSNR is higher or lower. Left of an arrow is the PSNR before.",
            )
        if run is not None and run.notes:
            imgui.text_wrapped(run.notes[-1])


def _progress(run: ActiveRun | None, ui: UiFrame) -> None:
    """Draw the progress bar of a run. It is full at the end, and animated while the progress is unknown."""
    progress = run.progress if run is not None else None
    is_known = progress is not None and progress.steps > 0
    share = 1.0 if run is None else progress.share if progress is not None and is_known else -0.6 * imgui.get_time()
    imgui.push_style_color(imgui.Col_.plot_histogram, imgui.ImVec4(*INKS["dark"]["a"]))
    # The text lies below the bar, because over it it would be hard to read.
    imgui.progress_bar(min(1.0, share), ImVec2(-1, grid(1.5)), "")
    imgui.pop_style_color()
    ui.rects.note("progress", "Progress of the run.")


def _state(run: ActiveRun | None, ended: Run | None) -> str:
    if run is None:
        return f"{ended.fate}. Keep it?" if ended is not None else ""
    state, progress = STATES[run.state], run.progress
    if progress is None:
        return f"{state or 'starting'}, {duration(time.monotonic() - run.began)}"
    if not progress.steps:
        return f"{state or progress.work}, {duration(progress.elapsed_seconds)}"
    left = run.seconds_left
    rest = state or (f"{duration(left)} left" if left is not None else f"{duration(progress.elapsed_seconds)} so far")
    return f"{progress.phase}, {percent(progress.share)}, {rest}"


def _log(ui: UiFrame) -> None:
    """Draw the table of all runs, the newest first."""
    imgui.text_disabled("runs")
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.borders_inner_v
    if not imgui.begin_table("runs", 5, flags):
        return
    for name in RUN_COLUMNS:
        imgui.table_setup_column(name, imgui.TableColumnFlags_.width_stretch if name == "what" else 0)
    headings({name: FIGURES[f"column {name}"] for name in RUN_COLUMNS}, ui.rects)
    shown = {"a": ui.session.view.slot_a.source, "b": ui.session.view.slot_b.source}
    for run in reversed(ui.training.log.runs):
        imgui.table_next_row()
        figures = pack_figures(run.pack) if run.pack is not None else None
        size = f", {figures.bits:.1f} bits, {figures.bytes / 1e6:.2g} MB" if figures is not None else ""
        cells(str(run.number), f"{run.title}{size}")
        if imgui.is_item_hovered():
            saved = (f"saved to {run.saved}",) if run.saved is not None else ()
            about = (
                run.title,
                run.settings,
                f"{counted(run.groups, 'group')}, {run.fate}",
                psnr_of_run(run),
                *saved,
                *run.lines[:12],
            )
            ui.rects.tip("\n".join(about))
        _decision(run, ui)
        cells("-" if run.psnr_db is None else f"{run.psnr_db:.2f}", "-" if run.earlier else duration(run.seconds))
        imgui.table_next_column()
        for side in ("a", "b"):
            name = side.upper()
            missing = "" if run.has_pack else "the run has no pack"
            missing = missing or (f"slot {name} shows it" if shown[side] == run.name else "")
            label = f"run {run.number} into {name}"
            values = (run.number, side)
            command_button(
                ui,
                f"{name}##{run.number}",
                "training.show",
                *values,
                label=label,
                tip=SHOW_RUN,
                missing=missing,
                small=True,
            )
            imgui.same_line()
        imgui.new_line()
    imgui.end_table()


def _decision(run: Run, ui: UiFrame) -> None:
    """Draw the buttons that save or discard a run, below its title."""
    if run.has_pack and run.saved is None:
        label = f"keep run {run.number}"
        command_button(
            ui, f"Keep##{run.number}", "training.keep", Path(), run.number, label=label, tip=KEEP_RUN, small=True
        )
    if run.is_unsaved:
        imgui.same_line()
        label = f"discard run {run.number}"
        command_button(
            ui, f"Discard##{run.number}", "training.discard", run.number, label=label, tip=DISCARD_RUN, small=True
        )


OFFER_WIDTH, OFFER_HEIGHT = 21.0, 14.0
"""Width and approximate height of the offer, in font sizes."""
OFFER_CORNERS = ((1, 0), (1, 1), (0, 1))
"""Corners of the picture where the offer may lie: (1 for right, 1 for bottom), the first preferred."""


class EncodeOffer:
    """Card over the picture that offers to encode a scene without a pack, until it is answered."""

    def __init__(self) -> None:
        self._answered_for: object = None
        self._placed_for: object = None
        self._corner = OFFER_CORNERS[0]
        self._form = EncodeForm("offer")

    def draw(self, ui: UiFrame, area: Area, beside_card: Area) -> Area:
        """Draw the offer in a corner of `area`, if the scene has no pack. Returns the part of `area` above an offer in a lower corner,
        else `area`. `beside_card` is the part of `area` that the card of first steps leaves free."""
        if ui.training.state != "idle":
            self._answered_for = ui.session.scene
        if (
            ui.session.packs
            or any(not run.earlier for run in ui.training.log.runs)
            or ui.session.scene is self._answered_for
            or not ui.session.scene.textures
        ):
            return area
        if {ui.session.view.slot_a.source, ui.session.view.slot_b.source} != {REFERENCE}:
            return area
        if beside_card.bottom < area.bottom:
            return area  # There is no room beside the card of first steps; the offer appears when that is closed.
        # The width does not depend on the content, so rows do not move when texts change.
        width = min(em(OFFER_WIDTH), max(area.width - grid(6), em(12.0)))
        # The lower left belongs to the card of first steps. After it closes, a second click there must not hit the offer.
        corners = OFFER_CORNERS[: 2 if ui.session.window.show_first_steps else 3]
        rooms = {corner: room for corner in corners if (room := card_room(ui.rects, area, width, bool(corner[0])))}
        key = (ui.session.scene, area.width, area.height)
        if rooms and (self._placed_for != key or self._corner not in rooms) and not ui.session.seeks_first_view:
            # The corner is chosen once for a scene and area, so the offer does not move with the camera.
            self._placed_for, self._corner = key, _emptiest(rooms, ui, area)
        if self._corner not in rooms:
            return area
        with card("##offer", rooms[self._corner], at_bottom=bool(self._corner[1])):
            imgui.text_wrapped("This scene has no pack.")
            if unsaved := ui.training.log.unsaved_runs:
                title, values = f"Show the unsaved run {unsaved[-1].title}", (unsaved[-1].number, "a")
                command_button(ui, title, "training.show", *values, label="Show unsaved run", tip=SHOW_UNSAVED_RUN)
            self._form.draw(ui)
            command_button(ui, "Encode it now", "training.encode", missing=self._form.problem)
            imgui.same_line()
            if imgui.button("Not now"):
                self._answered_for = ui.session.scene
            ui.rects.note("Not now", "Close this card. The panel Training offers the same.")
            top = imgui.get_window_pos().y
        return replace(area, bottom=top) if self._corner[1] else area


def _emptiest(rooms: Mapping[tuple[int, int], Area], ui: UiFrame, area: Area) -> tuple[int, int]:
    """Return the corner where the offer hides least of the scene. Corners with too little height are used only if all are."""
    corners = [corner for corner, room in rooms.items() if room.height >= em(OFFER_HEIGHT)] or list(rooms)
    boxes = []
    for corner in corners:
        room = rooms[corner]
        top = max(room.top, room.bottom - em(OFFER_HEIGHT)) if corner[1] else room.top
        boxes.append((*area.share_of(room.left, top), *area.share_of(room.right, top + em(OFFER_HEIGHT))))
    return corners[emptiest(ui.session.scene, ui.session.view.camera, (round(area.width), round(area.height)), boxes)]
