"""Every widget, column and figure says what it is: it has a tooltip, also in a window at rest."""

import ast
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from imgui_bundle import imgui

import viewer.ui
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE
from viewer.commands.menus import MENUS
from viewer.scene.model import Scene
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings
from viewer.ui.widgets import TOOLTIP_SECONDS, WidgetRects

MAKE_WIDGETS = (
    *("button", "small_button", "arrow_button", "image_button", "invisible_button", "checkbox", "radio_button"),
    *("selectable", "menu_item", "menu_item_simple", "begin_menu", "begin_combo", "begin_tab_item", "table_header"),
    *("slider_float", "slider_int", "drag_float", "input_text", "input_text_with_hint", "input_int", "input_float"),
    *(
        "tree_node",
        "tree_node_ex",
        "collapsing_header",
        "table_headers_row",
        "menu_item_ex",
        "begin_menu_ex",
    ),
)
"""ImGui's functions after which `rects.note` or `rects.tip` is due."""
VIEWS = (
    (),
    ("compare.mode difference", "overlay.toggle", "pixel.panel", "errors.panel", "histogram.panel"),
    ("compare.mode wipe", "materials.view lit", "slot.source b reference"),
)
"""Commands before panels are drawn: between them they show all that panels can show at rest."""


def without_tooltip(tree: ast.AST) -> list[str]:
    """Widgets of a module that are drawn before another one, or the end of their function, without a tooltip after them."""
    found = list[str]()
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        calls = [
            node for node in ast.walk(function) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        ]
        last: str | None = None
        for call in sorted(calls, key=lambda call: (call.lineno, call.col_offset)):
            name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
            if name in MAKE_WIDGETS:
                # One line may draw one of two.
                found += [last] if last and last != f"line {call.lineno}" else []
                last = f"line {call.lineno}"
            elif name in ("note", "tip"):
                last = None
        found += [last] if last else []
    return found


@pytest.mark.parametrize("path", sorted(Path(viewer.ui.__file__).parent.rglob("*.py")), ids=lambda path: path.stem)
def test_every_widget_has_a_tooltip(path: Path) -> None:
    assert without_tooltip(ast.parse(path.read_text())) == []


@pytest.fixture(scope="module")
def shared(scene: Scene, scene_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenApp]:
    packs = open_packs(packs_beside(scene_path))
    made = DrivenApp(scene, packs, (1600, 1000), tmp_path_factory.mktemp("pictures"), ViewerSettings())
    # Nobody looks at the picture.
    made.session.resolution = 0.25
    made.settle()
    yield made
    made.close()


def unexplained(rects: WidgetRects) -> set[str]:
    return {label for label, tip in rects.tips.items() if not tip}


@pytest.mark.parametrize("commands", VIEWS)
def test_every_label_of_every_panel_is_explained(shared: DrivenApp, commands: tuple[str, ...]) -> None:
    for line in commands:
        name, *values = line.split()
        shared.run(name, *values)
    shared.settle()
    missing: dict[str, str] = {}
    for title in shared.frontend.interface.panel_titles:
        shared.show_panel(title)
        missing |= dict.fromkeys(unexplained(shared.widgets), title)
        for label in [label for label in shared.widgets.labels() if label.startswith("tab ")]:
            shared.click(label)
            missing |= dict.fromkeys(unexplained(shared.widgets), f"{title}, {label}")
    if missing:
        pytest.fail(f"labels (and their panels) without an explanation: {missing}", pytrace=False)


@pytest.mark.parametrize("menu", MENUS)
def test_every_entry_of_every_menu_is_explained(shared: DrivenApp, menu: str) -> None:
    shared.click(f"menu: {menu}")
    assert any(label.startswith("menu: ") and "." in label for label in shared.widgets.labels())
    assert [label for label in unexplained(shared.widgets) if label.startswith("menu: ")] == []
    shared.press(imgui.Key.escape)


def test_other_windows_are_explained(app: DrivenApp) -> None:
    app.run("texture.flat", "0")
    app.settle()
    missing = unexplained(app.widgets)
    app.run("texture.close-flat")
    for command in ("help.keys", "help.glossary", "help.palette", "file.open", "help.first-steps"):
        app.run(command)
        app.settle()
        missing |= unexplained(app.widgets)
        app.run(command)
    if missing:
        pytest.fail(f"labels without an explanation: {missing}", pytrace=False)


def test_a_tooltip_appears_where_the_mouse_rests_and_says_when_it_is_due(app: DrivenApp) -> None:
    app.move(*app.widgets.centre("Measure"))
    tooltips = app.widgets.tooltips
    assert tooltips.seconds_until_due is not None, "a window at rest must know that a frame is due"
    assert 0.0 < app.frontend.seconds_until_change <= TOOLTIP_SECONDS
    time.sleep(TOOLTIP_SECONDS + 0.05)
    assert app.frontend.needs_frame(SIZE)
    before = app.screenshot()
    for _ in range(30):
        app.frame()
    assert tooltips.seconds_until_due is None, "it is there"
    assert (app.screenshot() != before).any()
    app.move(SIZE[0] / 2, SIZE[1] / 2)
    assert tooltips.seconds_until_due is None
