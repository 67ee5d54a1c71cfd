"""The scene's nodes and materials as lists in the panel Scene: only rows in sight are made."""

from imgui_bundle import imgui

from viewer.inspect.scene_tree import SceneTree
from viewer.scene.model import Material, Scene
from viewer.state.session import Session
from viewer.ui.facts import Emit
from viewer.ui.widgets import WidgetRects


def _material_text(number: int, material: Material, scene: Scene) -> str:
    texture = scene.textures[material.texture_id].name if material.texture_id >= 0 else "no texture"
    extras: list[str] = [material.alpha_mode] if material.alpha_mode != "opaque" else []
    extras += ["double-sided"] if material.double_sided else []
    factor = (
        ""
        if all(value == 1.0 for value in material.factor)
        else " x (" + ", ".join(f"{value:.2f}" for value in material.factor) + ")"
    )
    return f"{number}  {material.name or 'material'}: {texture}{factor}" + (f", {', '.join(extras)}" if extras else "")


class SceneLists:
    """Remembers the filter, and which nodes are folded out."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._tree: SceneTree | None = None
        self._filter = ""
        self._materials: list[int] = []

    @property
    def tree(self) -> SceneTree | None:
        """The rows of nodes, for scripts."""
        return self._tree

    def draw(self, session: Session, emit: Emit, items: WidgetRects) -> None:
        """Filter, nodes and materials."""
        scene = session.scene
        if self._tree is None or self._scene is not scene:
            self._scene, self._tree = scene, SceneTree(scene)
            self._find(scene, self._tree)
        imgui.set_next_item_width(-1)
        changed, self._filter = imgui.input_text_with_hint("##nodes", "find nodes and materials", self._filter)
        items.note("scene filter")
        if changed:
            self._find(scene, self._tree)
        opened = imgui.tree_node(f"nodes ({self._tree.node_count:,})###nodes")
        items.note("nodes")
        if opened:
            self._nodes(self._tree, session, emit, items)
            imgui.tree_pop()
        opened = imgui.tree_node(f"materials ({len(self._materials):,})###materials")
        items.note("materials")
        if opened:
            self._material_rows(session, emit, items)
            imgui.tree_pop()

    def _find(self, scene: Scene, tree: SceneTree) -> None:
        tree.filter(self._filter)
        words = self._filter.casefold().split()
        self._materials = [
            number
            for number, material in enumerate(scene.materials)
            if all(word in _material_text(number, material, scene).casefold() for word in words)
        ]

    def _nodes(self, tree: SceneTree, session: Session, emit: Emit, items: WidgetRects) -> None:
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
                    items.note(f"node {row.node}")
                    continue
                imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + indent)
                chosen = 0 <= row.texture_id == session.inspection.selected_texture
                if imgui.selectable(f"{row.label}##instance {row.instance}", chosen)[0] and row.texture_id >= 0:
                    emit("texture.select", str(row.texture_id))
                items.note(f"instance {row.instance}")
        if toggled is not None:
            # After the loop: the rows must not change under the clipper.
            tree.toggle(toggled)

    def _material_rows(self, session: Session, emit: Emit, items: WidgetRects) -> None:
        clipper = imgui.ListClipper()
        clipper.begin(len(self._materials))
        flags = imgui.SelectableFlags_.allow_double_click
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                number = self._materials[index]
                material = session.scene.materials[number]
                texture = material.texture_id
                text = _material_text(number, material, session.scene)
                chosen = imgui.selectable(
                    f"{text}##material {number}", 0 <= texture == session.inspection.selected_texture, flags
                )[0]
                items.note(f"material {number}")
                if chosen and texture >= 0:
                    doubly = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
                    emit("texture.flat" if doubly else "texture.select", str(texture))
