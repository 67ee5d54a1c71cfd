"""Panel "Training": the offer to encode, what is under way with its curves, the decision about it, and the log of runs."""

import time

from imgui_bundle import ImVec2, imgui

from viewer.state.pack_files import base_pack_name
from viewer.state.view_state import REFERENCE
from viewer.training.active_run import ActiveRun
from viewer.training.preparation import job_title
from viewer.training.run_log import Run
from viewer.training.settings import TrainingSettings
from viewer.ui.facts import UiFrame
from viewer.ui.panels.kept_runs import draw_kept_runs
from viewer.ui.panels.training_curves import TrainingCurves
from viewer.ui.panels.training_figures import figures_of_run, figures_under_way, psnr_of_run
from viewer.ui.panels.training_forms import TrainingForms
from viewer.ui.style.fitting import em, wrapped_disabled
from viewer.ui.widgets import SLOT_COLORS, Area, cells, duration, headings, shortened

RUN_COLUMNS = ("run", "what", "dB", "time", "into")
UNSTOPPABLE = ("preparing", "cancelling")
"""States in which a run cannot pause."""
STATES = {
    "preparing": "preparing textures and groups",
    "training": "",
    "pausing": "pausing",
    "paused": "paused",
    "cancelling": "cancelling",
}


class TrainingPanel:
    """The panel of one window."""

    def __init__(self) -> None:
        self._forms = TrainingForms(TrainingSettings())
        self._curves = TrainingCurves()
        self._path = ""

    def draw(self, ui: UiFrame) -> None:
        """The content of the panel."""
        run, log = ui.training.active, ui.training.log
        if run is not None or log.undecided is not None:
            self._run(run, None if run is not None else log.undecided_run(), ui)
        if run is not None:
            names = [texture.name for texture in run.request.textures] if run.request is not None else []
            self._curves.draw(run.curves, names, run.codec_kind, ui)
        else:
            if log.undecided is not None:
                imgui.separator()
            draw_kept_runs(ui)
            name = base_pack_name(ui.session.view, ui.session.packs)
            self._forms.draw(ui.session.packs[name] if name is not None else None, name or "", ui)
            if ui.training.curves is not None and len(ui.training.curves.seconds) > 1:
                opened = imgui.tree_node("curves of the last run")
                ui.rects.note("curves of the last run")
                if opened:
                    last = log.runs[-1] if log.runs else None
                    pack = last.pack if last is not None else None
                    names = [texture.name for texture in pack.textures] if pack is not None else []
                    kind = pack.config.kind if pack is not None else None
                    self._curves.draw(ui.training.curves, names, kind, ui)
                    imgui.tree_pop()
        if log.runs:
            imgui.separator()
            _log(ui)

    def _run(self, run: ActiveRun | None, ended: Run | None, ui: UiFrame) -> None:
        """A run from its beginning to the decision about it. Lines and buttons above the figures are as many in all of its states: a
        click that comes as it ends hits nothing else."""
        style = imgui.get_style()
        # As if there were a scroll bar: curves bring one, and buttons would move aside for it.
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
        self._button("Resume" if waits else "Pause", half, run is not None and run.state not in UNSTOPPABLE, ui)
        imgui.same_line()
        self._button("Cancel", half, run is not None and run.state != "cancelling", ui)
        decides = ended is not None and not ui.training.saving
        self._button("Accept", half, decides, ui)
        imgui.same_line()
        self._button("Discard", half, decides, ui)
        if ended is not None:
            imgui.set_next_item_width(-1)
            self._path = imgui.input_text_with_hint("##file", "file: empty for one beside the scene", self._path)[1]
            ui.rects.note("file")
        for line in figures_under_way(run) if run is not None else figures_of_run(ended) if ended is not None else ():
            imgui.text_wrapped(line)
            ui.rects.note("training figure")
        if run is not None and run.notes:
            imgui.text_wrapped(run.notes[-1])

    def _button(self, label: str, width: float, enabled: bool, ui: UiFrame) -> None:
        imgui.begin_disabled(not enabled)
        if imgui.button(label, ImVec2(width, 0)):
            ui.emit(f"training.{label.lower()}", *((self._path.strip(),) if label == "Accept" else ()))
        ui.rects.note(label)
        imgui.end_disabled()


def _progress(run: ActiveRun | None, ui: UiFrame) -> None:
    """How far a run is; full where it has ended, and moving while that is not known."""
    progress = run.progress if run is not None else None
    share = 1.0 if run is None else -0.6 * imgui.get_time() if progress is None else progress.share
    imgui.push_style_color(imgui.Col_.plot_histogram, imgui.ImVec4(*SLOT_COLORS["a"]))
    # The text stands below: over the bar it would be hard to read.
    imgui.progress_bar(min(1.0, share), ImVec2(-1, 6), "")
    imgui.pop_style_color()
    ui.rects.note("progress")


def _state(run: ActiveRun | None, ended: Run | None) -> str:
    if run is None:
        return f"{ended.fate}. Keep it?" if ended is not None else ""
    state, progress = STATES[run.state], run.progress
    if progress is None:
        return f"{state or 'starting'}, {duration(time.monotonic() - run.began)}"
    return f"{progress.work} {progress.step} of {progress.steps}, {state or duration(progress.seconds_left) + ' left'}"


def _log(ui: UiFrame) -> None:
    """All runs, newest first."""
    imgui.text_disabled("runs")
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.borders_inner_v
    if not imgui.begin_table("runs", 5, flags):
        return
    for name in RUN_COLUMNS:
        imgui.table_setup_column(name, imgui.TableColumnFlags_.width_stretch if name == "what" else 0)
    headings(RUN_COLUMNS, ui.rects)
    shown = {"a": ui.session.view.slot_a.source, "b": ui.session.view.slot_b.source}
    for run in reversed(ui.training.log.runs):
        imgui.table_next_row()
        cells(str(run.number), run.title)
        if imgui.is_item_hovered():
            saved = (f"written to {run.saved}",) if run.saved is not None else ()
            about = (
                run.title,
                run.settings,
                f"{run.groups} groups, {run.fate}",
                psnr_of_run(run),
                *saved,
                *run.lines[:12],
            )
            ui.rects.tip("\n".join(about))
        cells("-" if run.psnr_db is None else f"{run.psnr_db:.2f}", duration(run.seconds))
        imgui.table_next_column()
        for side in ("a", "b"):
            imgui.begin_disabled(run.pack is None or shown[side] == run.name)
            if imgui.small_button(f"{side.upper()}##{run.number}"):
                ui.emit("training.show", run.number, side)
            ui.rects.note(f"run {run.number} into {side.upper()}")
            imgui.end_disabled()
            if side == "a":
                imgui.same_line()
    imgui.end_table()


class EncodeOffer:
    """A question over the picture where a scene has no pack, until it is answered."""

    def __init__(self) -> None:
        self._answered_for: object = None

    def draw(self, ui: UiFrame, area: Area) -> None:
        """The question, if it is to be asked, at the upper edge of `area`."""
        if ui.training.state != "idle":
            self._answered_for = ui.session.scene
        if (
            ui.session.packs
            or ui.training.log.runs
            or ui.session.scene is self._answered_for
            or not ui.session.scene.textures
        ):
            return
        if {ui.session.view.slot_a.source, ui.session.view.slot_b.source} != {REFERENCE}:
            return
        imgui.set_next_window_pos(
            ImVec2((area.left + area.right) / 2.0, area.top + 40.0), imgui.Cond_.always, ImVec2(0.5, 0.0)
        )
        imgui.set_next_window_bg_alpha(0.88)
        flags = (
            imgui.WindowFlags_.no_decoration
            | imgui.WindowFlags_.always_auto_resize
            | imgui.WindowFlags_.no_saved_settings
            | imgui.WindowFlags_.no_focus_on_appearing
            | imgui.WindowFlags_.no_nav
        )
        if imgui.begin("##offer", None, flags)[0]:
            settings = TrainingSettings()
            imgui.push_text_wrap_pos(min(em(30.0), max(area.width - em(4.0), em(10.0))))
            imgui.text_wrapped("This scene has no pack.")
            kept = ui.training.waiting.of(ui.session.scene)
            if kept and imgui.button(f"Open what was kept back at {kept[0].clock}"):
                ui.emit("training.kept-back", "open", ui.training.waiting.runs.index(kept[0]) + 1)
            if kept:
                ui.rects.note("Open what was kept back")
            wrapped_disabled(f"{settings.texture_size} texels, {settings.bits:g} bits each; more in the panel Training")
            imgui.pop_text_wrap_pos()
            if imgui.button("Encode it now"):
                ui.emit("training.encode")
            ui.rects.note("Encode it now")
            imgui.same_line()
            if imgui.button("Not now"):
                self._answered_for = ui.session.scene
            ui.rects.note("Not now")
        imgui.end()
