"""The list of runs that windows before this one have left undecided, in the panel Training."""

from imgui_bundle import ImVec2, imgui

from viewer.ui.facts import UiFrame

GAP = 4.0
"""Window units between buttons."""
ACTIONS = (("open", "Open"), ("keep", "Keep"), ("discard", "Discard"))


def draw_kept_runs(ui: UiFrame) -> None:
    """Each of them with its scene and time, and what can be done with it; nothing where there is none."""
    runs = ui.training.waiting.runs
    if not runs:
        return
    imgui.text_wrapped("Kept back from the last time:")
    ui.rects.note("kept back")
    for number, run in enumerate(runs, 1):
        imgui.text_wrapped(run.line)
        quality = f", {run.psnr_db:.2f} dB" if run.psnr_db is not None else ""
        if imgui.is_item_hovered():
            ui.rects.tip("\n".join((run.title, run.settings, f"{run.outcome}{quality}", run.scene_path)))
        width = (imgui.get_content_region_avail().x - GAP * (len(ACTIONS) - 1)) / len(ACTIONS)
        for index, (action, title) in enumerate(ACTIONS):
            if index:
                imgui.same_line(0.0, GAP)
            if imgui.button(f"{title}##kept{number}", ImVec2(width, 0.0)):
                ui.emit("training.kept-back", action, number)
            ui.rects.note(f"{action} kept back {number}")
    imgui.separator()
