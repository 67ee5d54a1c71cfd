"""Panel "Training": the offer to encode, what is under way with its curves, the decision about it, and the log of runs."""

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
from viewer.ui.panels.training_forms import TrainingForms
from viewer.ui.widgets import SLOT_COLORS, Area, cells, duration, headings

RUN_COLUMNS = ("run", "what", "dB", "time", "into")
STATES = {
    "preparing": "preparing textures and groups",
    "training": "",
    "pausing": "about to pause",
    "paused": "paused",
    "cancelling": "about to end",
}


class TrainingPanel:
    """The panel of one window."""

    def __init__(self) -> None:
        self._forms = TrainingForms(TrainingSettings())
        self._curves = TrainingCurves()
        self._path = ""

    def draw(self, ui: UiFrame) -> None:
        """The content of the panel."""
        run = ui.training.active
        if run is not None:
            self._under_way(run, ui)
            names = [texture.name for texture in run.request.textures] if run.request is not None else []
            self._curves.draw(run.curves, names, run.codec_kind, ui)
        else:
            draw_kept_runs(ui)
            if ui.training.log.undecided is not None:
                self._decision(ui, ui.training.log.undecided_run())
                imgui.separator()
            name = base_pack_name(ui.session.view, ui.session.packs)
            self._forms.draw(ui.session.packs[name] if name is not None else None, name or "", ui)
            if ui.training.curves is not None and len(ui.training.curves.seconds) > 1:
                opened = imgui.tree_node("curves of the last run")
                ui.rects.note("curves of the last run")
                if opened:
                    last = ui.training.log.runs[-1] if ui.training.log.runs else None
                    pack = last.pack if last is not None else None
                    names = [texture.name for texture in pack.textures] if pack is not None else []
                    kind = pack.config.kind if pack is not None else None
                    self._curves.draw(ui.training.curves, names, kind, ui)
                    imgui.tree_pop()
        if ui.training.log.runs:
            imgui.separator()
            _log(ui)

    def _under_way(self, run: ActiveRun, ui: UiFrame) -> None:
        progress = run.progress
        imgui.text_wrapped(f"{run.name}: {job_title(run.job)}")
        state = STATES[run.state]
        share = -0.6 * imgui.get_time() if progress is None else progress.step / max(1, progress.steps)
        imgui.push_style_color(imgui.Col_.plot_histogram, imgui.ImVec4(*SLOT_COLORS["a"]))
        # The text stands below: over the bar it would be hard to read.
        imgui.progress_bar(min(1.0, share), ImVec2(-1, 6), "")
        imgui.pop_style_color()
        ui.rects.note("progress")
        if progress is None:
            imgui.text(state or "starting")
        else:
            counted = "texture" if run.codec_kind == "block" else "step"
            imgui.text(
                f"{counted} {progress.step} of {progress.steps}, {state or duration(progress.seconds_left) + ' left'}"
            )
        waits = run.state in ("paused", "pausing")
        third = (imgui.get_content_region_avail().x - 8.0) / 2.0
        imgui.begin_disabled(run.state in ("preparing", "cancelling"))
        if imgui.button("Resume" if waits else "Pause", ImVec2(third, 0)):
            ui.emit("training.resume" if waits else "training.pause")
        ui.rects.note("Resume" if waits else "Pause")
        imgui.end_disabled()
        imgui.same_line()
        imgui.begin_disabled(run.state == "cancelling")
        if imgui.button("Cancel", ImVec2(-1, 0)):
            ui.emit("training.cancel")
        ui.rects.note("Cancel")
        imgui.end_disabled()
        if progress is not None:
            mean = f"{run.curves.mean_db[-1]:.2f} dB" if run.curves.mean_db else "-"
            freezing = "" if run.codec_kind == "block" else f"   freezing {progress.freezing_scale:.2f}"
            imgui.text(f"PSNR {mean}   {progress.ktexels_per_second:.0f} Ktexel/s{freezing}")
        if run.notes:
            imgui.text_wrapped(run.notes[-1])

    def _decision(self, ui: UiFrame, run: Run) -> None:
        quality = f", {run.psnr_db:.2f} dB" if run.psnr_db is not None else ""
        imgui.text_wrapped(f"{run.name}: {run.fate}{quality}. Keep it?")
        imgui.set_next_item_width(-1)
        self._path = imgui.input_text_with_hint("##file", "file; without one beside the scene", self._path)[1]
        ui.rects.note("file")
        half = (imgui.get_content_region_avail().x - 8.0) / 2.0
        imgui.begin_disabled(ui.training.saving)
        if imgui.button("writing ..." if ui.training.saving else "Accept", ImVec2(half, 0)):
            ui.emit("training.accept", self._path.strip())
        ui.rects.note("Accept")
        imgui.same_line()
        if imgui.button("Discard", ImVec2(-1, 0)):
            ui.emit("training.discard")
        ui.rects.note("Discard")
        imgui.end_disabled()


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
            about = (run.title, run.settings, f"{run.groups} groups, {run.fate}", *saved, *run.lines[:12])
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
            imgui.text("This scene has no pack.")
            kept = ui.training.waiting.of(ui.session.scene)
            if kept and imgui.button(f"Open what was kept back at {kept[0].clock}"):
                ui.emit("training.kept-back", "open", ui.training.waiting.runs.index(kept[0]) + 1)
            if kept:
                ui.rects.note("Open what was kept back")
            imgui.text_disabled(
                f"{settings.texture_size} texels, {settings.bits:g} bits each; more in the panel Training"
            )
            if imgui.button("Encode it now"):
                ui.emit("training.encode")
            ui.rects.note("Encode it now")
            imgui.same_line()
            if imgui.button("Not now"):
                self._answered_for = ui.session.scene
            ui.rects.note("Not now")
        imgui.end()
