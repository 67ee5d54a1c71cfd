"""Colours that several panels share."""

import numpy as np
from imgui_bundle import imgui

from viewer.state.palettes import PaletteName, palette_colors, share_of_most

SLOT_COLORS = {"a": (0.35, 0.65, 1.0, 1.0), "b": (1.0, 0.6, 0.25, 1.0)}
"""Blue for A and orange for B: told apart by every kind of colour vision."""


def packed(rgba: tuple[float, float, float, float]) -> int:
    """A colour as ImGui's draw lists take it."""
    return imgui.color_convert_float4_to_u32(imgui.ImVec4(*rgba))


def heat(palette: PaletteName, decoders: float, most: int) -> tuple[float, float, float, float]:
    """sRGB and opacity 1: the map's colour of a number of decoders."""
    red, green, blue = palette_colors(palette, np.array(share_of_most(decoders, most))).tolist()
    return red, green, blue, 1.0
