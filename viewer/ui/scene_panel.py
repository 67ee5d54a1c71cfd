"""Panel "Scene": cameras, and what of the file is drawn, ignored or missing."""

import os
from pathlib import Path

from imgui_bundle import imgui

from viewer.scene.model import LoadReport, Scene
from viewer.scene.report import report_lines
from viewer.state.session import Session
from viewer.ui.facts import Emit
from viewer.ui.scene_tree_list import SceneLists
from viewer.ui.widgets import WidgetRects


class OpenField:
    """A line to type a path into."""

    def __init__(self) -> None:
        self._text = ""

    def draw(self, emit: Emit, items: WidgetRects) -> None:
        """The field and its button."""
        imgui.set_next_item_width(-60)
        entered, self._text = imgui.input_text_with_hint(
            "##path", "path of a .gltf, .glb or .ntc", self._text, imgui.InputTextFlags_.enter_returns_true
        )
        items.note("path")
        imgui.same_line()
        clicked = imgui.button("Open")
        items.note("Open")
        if (entered or clicked) and self._text.strip():
            emit("file.open", Path(os.path.expanduser(self._text.strip())))  # noqa: PTH111 - keeps what is no user
            self._text = ""


def _report(scene: Scene, items: WidgetRects) -> None:
    report: LoadReport = scene.report
    opened = imgui.tree_node_ex("load report", imgui.TreeNodeFlags_.default_open)
    items.note("load report")
    if not opened:
        return
    if imgui.small_button("copy report"):
        imgui.set_clipboard_text("\n".join(report_lines(scene)))
    items.note("copy report")
    _parts(report, items)
    imgui.tree_pop()


def _parts(report: LoadReport, items: WidgetRects) -> None:
    parts = {"honoured": report.honoured, "ignored": report.ignored, "missing": report.missing, "notes": report.notes}
    for name, lines in parts.items():
        if not lines:
            continue
        opened = imgui.tree_node_ex(
            f"{name} ({len(lines)})", imgui.TreeNodeFlags_.default_open if name == "missing" else 0
        )
        items.note(name)
        if opened:
            for line in lines:
                imgui.text_wrapped(line)
            imgui.tree_pop()


def draw_scene_panel(session: Session, field: OpenField, lists: SceneLists, emit: Emit, items: WidgetRects) -> None:
    """The content of the panel."""
    scene = session.scene
    imgui.text_wrapped(scene.path.name if scene.path is not None else scene.name)
    imgui.set_item_tooltip(str(scene.path or scene.name))
    used = scene.report.used
    imgui.text_disabled(
        ", ".join(f"{used[key]:,} {key}" for key in ("triangles", "materials", "textures") if key in used)
    )
    field.draw(emit, items)
    if imgui.button("Frame all"):
        emit("camera.frame-all")
    items.note("Frame all")
    if imgui.tree_node_ex(f"cameras ({len(scene.cameras)})", imgui.TreeNodeFlags_.default_open):
        for number, camera in enumerate(scene.cameras):
            label = f"{number + 1}  {camera.name}"
            if imgui.selectable(label, session.view.camera == camera)[0]:
                emit("camera.set", camera)
            items.note(f"camera {camera.name}")
        imgui.tree_pop()
    lists.draw(session, emit, items)
    _report(scene, items)
