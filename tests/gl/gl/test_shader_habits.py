"""What the specification leaves open, and drivers do differently, is in no shader."""

import re
from pathlib import Path

import pytest

from viewer.locations import shaders_folder

SHADERS = sorted(path for path in shaders_folder().rglob("*.*") if path.is_file())
DERIVATIVES = re.compile(r"\b(dFdx|dFdy|fwidth|texture)\s*\(")
OPEN = {
    r"\bis(nan|inf)\s*\(": "may be compiled to false: test bits (common/numbers.glsl)",
    r"\bexp2\s*\(\s*-?\s*(floor|float)": "need not be exact for whole numbers: shift",
}


def code(path: Path) -> str:
    """Without comments."""
    return re.sub(r"//.*", "", path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", [path for path in SHADERS if path.suffix == ".frag"], ids=lambda path: path.name)
def test_derivatives_come_before_pixels_are_discarded(path: Path) -> None:
    """After that they are undefined where a neighbour was discarded."""
    _, discards, after = code(path).partition("discard")
    assert not discards or not DERIVATIVES.search(after)


@pytest.mark.parametrize("pattern", OPEN)
def test_no_shader_relies_on_what_is_left_open(pattern: str) -> None:
    assert [path.name for path in SHADERS if re.search(pattern, code(path))] == [], OPEN[pattern]
