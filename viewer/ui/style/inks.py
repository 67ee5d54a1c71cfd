"""Colours of texts and curves that are not ImGui's own, for each theme: readable on its panels."""

from collections.abc import Mapping
from typing import Literal

from imgui_bundle import imgui

from viewer.state.settings import Theme

InkName = Literal["a", "b", "scene", "mean", "error", "good", "red", "green", "blue"]
Rgba = tuple[float, float, float, float]
INKS: Mapping[Theme, Mapping[InkName, Rgba]] = {
    "dark": {
        "a": (0.35, 0.65, 1.0, 1.0),
        "b": (1.0, 0.6, 0.25, 1.0),
        "scene": (0.62, 0.64, 0.67, 1.0),
        "mean": (0.95, 0.95, 0.95, 1.0),
        "error": (1.0, 0.5, 0.45, 1.0),
        "good": (0.3, 0.75, 0.4, 1.0),
        "red": (0.95, 0.42, 0.37, 1.0),
        "green": (0.4, 0.85, 0.4, 1.0),
        "blue": (0.45, 0.65, 1.0, 1.0),
    },
    "light": {
        "a": (0.06, 0.36, 0.72, 1.0),
        "b": (0.6, 0.27, 0.0, 1.0),
        "scene": (0.36, 0.38, 0.41, 1.0),
        "mean": (0.1, 0.1, 0.12, 1.0),
        "error": (0.7, 0.08, 0.04, 1.0),
        "good": (0.03, 0.42, 0.14, 1.0),
        "red": (0.72, 0.1, 0.08, 1.0),
        "green": (0.03, 0.42, 0.14, 1.0),
        "blue": (0.1, 0.3, 0.8, 1.0),
    },
}
"""sRGB and opacity. Blue for A and orange for B: told apart by every kind of colour vision."""


def ink(name: InkName) -> imgui.ImVec4:
    """A colour in the theme that ImGui's style has now."""
    ground = imgui.get_style().color_(imgui.Col_.window_bg)
    theme: Theme = "light" if ground.x + ground.y + ground.z > 1.5 else "dark"
    return imgui.ImVec4(*INKS[theme][name])


def side_ink(side: str) -> imgui.ImVec4:
    """Of slot A ("a") or B."""
    return ink("a" if side == "a" else "b")
