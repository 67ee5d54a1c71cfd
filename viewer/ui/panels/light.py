"""Panel "Light": what of the materials is shown, and what lights it."""

from pathlib import Path
from typing import get_args

from imgui_bundle import imgui

from viewer.commands.materials import VIEWS
from viewer.state.view_state import (
    ELEVATION_RANGE,
    OWN_ENVIRONMENTS,
    REFERENCE,
    SKY,
    DecodedMaps,
    MaterialView,
    ToneMap,
)
from viewer.ui.controls import command_list, slider
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import combo, em, wrapped_disabled

STRENGTHS = (0.0, 4.0)
STOPS = (-4.0, 4.0)
"""Ranges of the sliders; commands take more."""
LABEL_WIDTH = 6.9
"""Width of the labels in font sizes."""


def _label(text: str, ui: UiFrame) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    ui.rects.explain(text)
    imgui.same_line(em(LABEL_WIDTH))
    imgui.set_next_item_width(-1)


def _slider(ui: UiFrame, label: str, value: float, ends: tuple[float, float], text: str) -> float | None:
    """Draw a labelled slider, and return its new value; None where it was not moved."""
    _label(label, ui)
    return slider(ui, label, value, ends, text)


def _draw_environment(ui: UiFrame) -> None:
    lighting = ui.session.view.lighting
    _label("environment", ui)
    shown = Path(lighting.environment).name
    chosen = combo("environment", shown, tuple(dict.fromkeys((*OWN_ENVIRONMENTS, shown))), ui.rects)
    if chosen != shown:
        ui.emit("light.environment", Path(chosen))
    if lighting.environment != SKY:
        turn = _slider(ui, "turned by", lighting.environment_turn, (0.0, 360.0), "%.0f deg")
        if turn is not None:
            ui.emit("light.turn", turn)


def _draw_light(ui: UiFrame) -> None:
    lighting = ui.session.view.lighting
    _draw_environment(ui)
    azimuth = _slider(ui, "sun from", lighting.sun_azimuth, (0.0, 360.0), "%.0f deg")
    elevation = _slider(ui, "sun height", lighting.sun_elevation, ELEVATION_RANGE, "%.0f deg")
    if azimuth is not None or elevation is not None:
        ui.emit(
            "light.sun",
            lighting.sun_azimuth if azimuth is None else azimuth,
            lighting.sun_elevation if elevation is None else elevation,
        )
    strength = _slider(ui, "sun", lighting.sun_strength, STRENGTHS, "x %.2f")
    if strength is not None:
        ui.emit("light.sun-strength", strength)
    stops = _slider(ui, "exposure", lighting.exposure, STOPS, "%+.2f stops")
    if stops is not None:
        ui.emit("light.exposure", stops)
    _label("tone map", ui)
    command_list(ui, "tone map", lighting.tone_map, get_args(ToneMap), "light.tone-map")
    wrapped_disabled("Shift + drag over the picture moves the sun.")


def _draw_decoded_maps(ui: UiFrame) -> None:
    """Draw the choice of decoded maps of each slot."""
    for side, slot in ui.session.view.slots.items():
        if slot.source == REFERENCE:
            continue
        letter = side.upper()
        _label(f"{letter} decodes", ui)
        command_list(ui, f"{letter} maps", slot.maps, get_args(DecodedMaps), "slot.maps", side)


def draw_light_panel(ui: UiFrame) -> None:
    """Draw the content of the panel; light is shown only where it has an effect."""
    view = ui.session.view.material_view
    _label("view", ui)
    command_list(ui, "materials", view, get_args(MaterialView), "materials.view")
    if view != "base":
        _draw_decoded_maps(ui)
    if view == "lit":
        _draw_light(ui)
    else:
        wrapped_disabled(VIEWS[view])
