"""Panel "Scene": cameras, animations, nodes, materials, and the load report."""

from imgui_bundle import imgui

from viewer.inspect.scene_tree import SceneTree, material_text
from viewer.scene.model import Scene
from viewer.scene.report import KINDS, report_lines
from viewer.state.motion import chosen_animation
from viewer.ui.controls import command_button, control, copy_button, select_texture
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.widgets import branch

NODES = "Nodes of the file, with the meshes that they place."
MATERIALS = "Materials of the file, each with its texture."
LOAD_REPORT = "Features and values of the file that are drawn, ignored, missing or repaired."


def draw_time_line(ui: UiFrame) -> None:
    """Draw the time line of the animations: play, time, speed."""
    session = ui.session
    animations = session.scene.animations
    with branch(
        ui.rects,
        f"animations ({len(animations)})###animations",
        "animations",
        "Time line of the scene's animations.",
        True,
    ) as unfolded:
        if unfolded and animations:
            _draw(ui)
        elif unfolded:
            imgui.text_disabled("The scene has no animations.")


def _draw(ui: UiFrame) -> None:
    session, pose = ui.session, ui.session.view.pose
    shown = chosen_animation(session.scene.animations, pose)
    if len(session.scene.animations) > 1:
        control(ui, "animation.time", 0.0, label="animation", width=-1.0)
    sign = "pause" if session.playback.is_playing else "play"
    command_button(ui, "Pause" if session.playback.is_playing else "Play", "animation.play", label="Play", icon=sign)
    imgui.same_line()
    rests = pose is None and not session.playback.is_playing
    command_button(ui, "Rest", "animation.rest", missing="the scene is at rest" if rests else "")
    imgui.same_line()
    control(ui, "animation.repeat")
    imgui.same_line()
    control(ui, "animation.speed", width=-1.0, names=lambda speed: f"x {speed:g}")
    imgui.set_next_item_width(-1)
    at = pose.seconds if pose is not None else 0.0
    label = f"%.2f of {shown.seconds:.2f} s" if pose is not None else f"at rest; {shown.seconds:.2f} s"
    moved, seconds = imgui.slider_float("##time", at, 0.0, shown.seconds, label, imgui.SliderFlags_.always_clamp)
    ui.rects.note("time", "Time in the animation, in seconds from its beginning.")
    if moved:
        ui.emit("animation.time", max(0.0, seconds), shown.name)


class SceneLists:
    """Lists of nodes and materials, with the filter and the expanded nodes."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._tree: SceneTree | None = None
        self._filter = ""
        self._materials: list[int] = []

    def draw(self, ui: UiFrame) -> None:
        """Draw filter, nodes and materials."""
        scene = ui.session.scene
        if self._tree is None or self._scene is not scene:
            self._scene, self._tree = scene, SceneTree(scene)
            self._find(scene, self._tree)
        imgui.set_next_item_width(-1)
        changed, self._filter = imgui.input_text_with_hint("##nodes", "find nodes and materials", self._filter)
        ui.rects.note("scene filter", "Shows nodes and materials whose names have all these words.")
        if changed:
            self._find(scene, self._tree)
        with branch(ui.rects, f"nodes ({self._tree.node_count:,})###nodes", "nodes", NODES) as unfolded:
            if unfolded:
                self._nodes(self._tree, ui)
        with branch(ui.rects, f"materials ({len(self._materials):,})###materials", "materials", MATERIALS) as unfolded:
            if unfolded:
                self._material_rows(ui)

    def _find(self, scene: Scene, tree: SceneTree) -> None:
        tree.filter(self._filter)
        words = self._filter.casefold().split()
        self._materials = [
            number
            for number, material in enumerate(scene.materials)
            if all(word in material_text(number, material, scene).casefold() for word in words)
        ]

    def _nodes(self, tree: SceneTree, ui: UiFrame) -> None:
        toggled: int | None = None
        indent = imgui.get_font_size()
        clipper = imgui.ListClipper()
        clipper.begin(len(tree))
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                row = tree[index]
                if row.instance < 0:
                    sign = "-" if tree.is_expanded(row.node) else "+"
                    if imgui.selectable(f"{sign} {row.label}##node {row.node}", False)[0]:
                        toggled = row.node
                    ui.rects.note(f"node {row.node}", "Click expands or collapses the node.")
                    continue
                imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + indent)
                chosen = 0 <= row.texture_id == ui.session.inspection.selected_texture
                if imgui.selectable(f"{row.label}##instance {row.instance}", chosen)[0] and row.texture_id >= 0:
                    ui.emit("texture.select", str(row.texture_id))
                ui.rects.note(
                    f"instance {row.instance}", "A mesh of this node. Click selects its texture in all panels."
                )
        if toggled is not None:
            # After the loop, because the rows must not change while the clipper runs.
            tree.toggle(toggled)

    def _material_rows(self, ui: UiFrame) -> None:
        clipper = imgui.ListClipper()
        clipper.begin(len(self._materials))
        flags = imgui.SelectableFlags_.allow_double_click
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                number = self._materials[index]
                material = ui.session.scene.materials[number]
                texture = material.texture_id
                text = material_text(number, material, ui.session.scene)
                chosen = imgui.selectable(
                    f"{text}##material {number}", 0 <= texture == ui.session.inspection.selected_texture, flags
                )[0]
                ui.rects.note(
                    f"material {number}",
                    "Click selects the material's texture in all panels; double-click opens its flat view.",
                )
                if chosen and texture >= 0:
                    select_texture(ui, texture)


def _report(scene: Scene, ui: UiFrame) -> None:
    with branch(ui.rects, "load report", "load report", LOAD_REPORT, True) as unfolded:
        if not unfolded:
            return
        copy_button(
            ui,
            "copy report",
            "copy report",
            "Copy the whole report to the clipboard.",
            lambda: "\n".join(report_lines(scene)),
        )
        for name in KINDS:
            lines: tuple[str, ...] = getattr(scene.report, name)
            if lines:
                with branch(ui.rects, f"{name} ({len(lines)})", name, FIGURES[name], name == "missing") as shown:
                    for line in lines if shown else ():
                        imgui.text_wrapped(line)


def draw_scene_panel(ui: UiFrame, lists: SceneLists) -> None:
    """Draw the content of the panel."""
    scene = ui.session.scene
    name = scene.path.name if scene.path is not None else scene.name
    imgui.text_wrapped(name if scene.title == scene.name else f"{scene.title}/{name}")
    ui.rects.tip(str(scene.path or scene.name))
    used = scene.report.used
    imgui.text_disabled(
        ", ".join(f"{used[key]:,} {key}" for key in ("triangles", "materials", "textures") if key in used)
    )
    command_button(ui, "Open...", "file.open")
    imgui.same_line()
    command_button(ui, "Frame all", "camera.frame-all")
    with branch(
        ui.rects,
        f"cameras ({len(scene.cameras)})",
        "cameras",
        "Cameras of the file. Keys 1 to 9 go to the first nine.",
        True,
    ) as unfolded:
        for number, camera in enumerate(scene.cameras if unfolded else ()):
            label = f"{number + 1}  {camera.name}"
            if imgui.selectable(label, ui.session.view.camera == camera)[0]:
                ui.emit("camera.set", camera)
            ui.rects.note(f"camera {camera.name}", "Go to this camera of the scene. Keys 1 to 9 go to the first nine.")
    draw_time_line(ui)
    lists.draw(ui)
    _report(scene, ui)
