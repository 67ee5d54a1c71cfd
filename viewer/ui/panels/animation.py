"""The time line of the scene's animations, in the panel "Scene"."""

from imgui_bundle import imgui

from viewer.state.animation_playback import chosen_animation
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import combo

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


def draw_time_line(ui: UiFrame) -> None:
    """Play, time, speed; greyed where the scene has no animations."""
    session = ui.session
    animations = session.scene.animations
    opened = imgui.tree_node_ex(f"animations ({len(animations)})###animations", imgui.TreeNodeFlags_.default_open)
    ui.rects.note("animations")
    if not opened:
        return
    if animations:
        _draw(ui)
    else:
        imgui.text_disabled("the scene has no animations")
    imgui.tree_pop()


def _draw(ui: UiFrame) -> None:
    session, pose = ui.session, ui.session.view.pose
    shown = chosen_animation(session.scene.animations, pose)
    if len(session.scene.animations) > 1:
        imgui.set_next_item_width(-1)
        names = tuple(animation.name for animation in session.scene.animations)
        chosen = combo("animation", shown.name, names, ui.rects)
        if chosen != shown.name:
            ui.emit("animation.time", 0.0, chosen)
    if imgui.button("Pause" if session.playback.is_playing else "Play"):
        ui.emit("animation.play")
    ui.rects.note("Play")
    imgui.same_line()
    imgui.begin_disabled(pose is None and not session.playback.is_playing)
    if imgui.button("Rest"):
        ui.emit("animation.rest")
    imgui.end_disabled()
    ui.rects.note("Rest")
    imgui.same_line()
    changed, _ = imgui.checkbox("repeat", session.playback.repeats)
    ui.rects.note("repeat")
    if changed:
        ui.emit("animation.repeat")
    imgui.same_line()
    imgui.set_next_item_width(-1)
    texts = tuple(f"x {speed:g}" for speed in SPEEDS)
    speed = combo("speed", f"x {session.playback.speed:g}", texts, ui.rects)
    if speed in texts and SPEEDS[texts.index(speed)] != session.playback.speed:
        ui.emit("animation.speed", SPEEDS[texts.index(speed)])
    imgui.set_next_item_width(-1)
    at = pose.seconds if pose is not None else 0.0
    label = f"%.2f of {shown.seconds:.2f} s" if pose is not None else f"at rest; {shown.seconds:.2f} s"
    moved, seconds = imgui.slider_float("##time", at, 0.0, shown.seconds, label, imgui.SliderFlags_.always_clamp)
    ui.rects.note("time")
    if moved:
        ui.emit("animation.time", max(0.0, seconds), shown.name)
