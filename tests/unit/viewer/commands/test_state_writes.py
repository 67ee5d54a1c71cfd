"""Only commands and event handlers change the session: nothing else assigns to its attributes or to those of its groups."""

import ast
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from typing import get_type_hints

import pytest

import viewer
from viewer.state.session import Session

ROOT = Path(viewer.__file__).parent
WRITERS = ("commands", "state")
"""Packages whose functions are commands and event handlers."""
GROUPS = {name for name, kind in get_type_hints(Session).items() if is_dataclass(kind) and name != "view"}
FILES = [path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[0] not in WRITERS]


def is_session(node: ast.expr) -> bool:
    """`session`, `_session`, `self.session`, `app.session` and so on."""
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name.lstrip("_") == "session"


def is_state(node: ast.expr, aliases: set[str]) -> bool:
    """A session, one of its groups, or a name for one of them."""
    if isinstance(node, ast.Name) and node.id in aliases:
        return True
    return is_session(node) or (isinstance(node, ast.Attribute) and node.attr in GROUPS and is_session(node.value))


def assigned(statement: ast.stmt) -> Iterator[ast.expr]:
    """What a statement assigns to."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign | ast.Delete):
        targets = list(statement.targets)
    elif isinstance(statement, ast.AugAssign | ast.AnnAssign | ast.For):
        targets = [statement.target]
    for target in targets:
        yield from target.elts if isinstance(target, ast.Tuple | ast.List) else (target,)


def writes(source: str) -> list[int]:
    """Lines that assign to an attribute of a session or of one of its groups, or call setattr on it."""
    nodes = list(ast.walk(ast.parse(source)))
    aliases = {
        target.id
        for node in nodes
        if isinstance(node, ast.Assign) and is_state(node.value, set())
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    lines = [
        node.lineno
        for node in nodes
        if isinstance(node, ast.stmt)
        for target in assigned(node)
        for place in [target.value if isinstance(target, ast.Subscript) else target]
        if isinstance(place, ast.Attribute) and is_state(place.value, aliases)
    ]
    lines += [
        node.lineno
        for node in nodes
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("setattr", "delattr")
        and is_state(node.args[0], aliases)
    ]
    return sorted(lines)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("session.view = view", [1]),
        ("self._session.window.toasts = ()", [1]),
        ("self.session.window.open_panels -= {title}", [1]),
        ("a, session.packs = 1, {}", [1]),
        ("window = session.window\nwindow.show_help = True", [2]),
        ("session.packs['a'] = pack", [1]),
        ("setattr(app.session, 'view', view)", [1]),
        ("self.session = session\nview = session.view\nx = session.window.toasts", []),
    ],
)
def test_writes_are_found(source: str, found: list[int]) -> None:
    assert writes(source) == found


def test_only_commands_and_event_handlers_change_the_session() -> None:
    assert {"navigation", "inspection", "window"} <= GROUPS
    assert len(FILES) > 100
    found = {str(path.relative_to(ROOT)): lines for path in FILES if (lines := writes(path.read_text()))}
    assert found == {}
