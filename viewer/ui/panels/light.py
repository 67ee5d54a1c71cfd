"""Panel "Light": what of the materials is shown, and what lights it."""

from pathlib import Path
from typing import get_args

from imgui_bundle import imgui

from viewer.commands.materials import VIEWS
from viewer.state.view_state import ELEVATION_RANGE, REFERENCE, SKY, DecodedMaps, MaterialView, ToneMap
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import combo

STRENGTHS = (0.0, 4.0)
STOPS = (-4.0, 4.0)
"""Ends of the sliders; commands take more."""
LABEL_WIDTH = 90.0
"""Window units, at normal scale."""


def _label(text: str, help_text: str) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.set_item_tooltip(help_text)
    imgui.same_line(LABEL_WIDTH * imgui.get_style().font_scale_main)
    imgui.set_next_item_width(-1)


def _slider(
    ui: UiFrame, label: str, value: float, ends: tuple[float, float], text: str, help_text: str
) -> float | None:
    """The value that the slider was moved to; None where it was not."""
    _label(label, help_text)
    moved, found = imgui.slider_float(f"##{label}", value, *ends, text, imgui.SliderFlags_.always_clamp)
    ui.rects.note(label)
    return round(found, 3) if moved else None


def _draw_environment(ui: UiFrame) -> None:
    lighting = ui.session.view.lighting
    _label(
        "environment",
        "What lights the scene from all sides: the sky that the sun makes, or a panorama. Drop an .hdr or .exr.",
    )
    is_sky = lighting.environment == SKY
    choices = (SKY,) if is_sky else (Path(lighting.environment).name, SKY)
    if combo("environment", choices[0], choices, ui.rects) == SKY and not is_sky:
        ui.emit("light.environment", Path(SKY))
    if not is_sky:
        turn = _slider(
            ui, "turned by", lighting.environment_turn, (0.0, 360.0), "%.0f deg", "About the vertical axis, degrees"
        )
        if turn is not None:
            ui.emit("light.turn", turn)


def _draw_light(ui: UiFrame) -> None:
    lighting = ui.session.view.lighting
    _draw_environment(ui)
    azimuth = _slider(
        ui, "sun from", lighting.sun_azimuth, (0.0, 360.0), "%.0f deg", "Degrees from north (-Z) towards east (+X)"
    )
    elevation = _slider(
        ui, "sun height", lighting.sun_elevation, ELEVATION_RANGE, "%.0f deg", "Degrees above the horizon"
    )
    if azimuth is not None or elevation is not None:
        ui.emit(
            "light.sun",
            lighting.sun_azimuth if azimuth is None else azimuth,
            lighting.sun_elevation if elevation is None else elevation,
        )
    strength = _slider(
        ui, "sun", lighting.sun_strength, STRENGTHS, "x %.2f", "Times the sun's own strength; 0 leaves it out"
    )
    if strength is not None:
        ui.emit("light.sun-strength", strength)
    stops = _slider(ui, "exposure", lighting.exposure, STOPS, "%+.2f stops", "One stop more is twice as bright")
    if stops is not None:
        ui.emit("light.exposure", stops)
    _label(
        "tone map",
        "How light becomes a picture: Khronos PBR Neutral keeps base colours, AgX bleaches bright light, none clips it",
    )
    tone_map = combo("tone map", lighting.tone_map, get_args(ToneMap), ui.rects)
    if tone_map != lighting.tone_map:
        ui.emit("light.tone-map", tone_map)
    imgui.text_disabled("Shift + drag over the picture moves the sun")


def _draw_decoded_maps(ui: UiFrame) -> None:
    """Which maps a slot decodes: one alone shows what its error does to the picture."""
    for side, slot in ui.session.view.slots.items():
        if slot.source == REFERENCE:
            continue
        letter = side.upper()
        _label(
            f"{letter} decodes", "All maps, or one among the original ones: what its error alone does to the picture"
        )
        chosen = combo(f"{letter} maps", slot.maps, get_args(DecodedMaps), ui.rects)
        if chosen != slot.maps:
            ui.emit("slot.maps", side, chosen)


def draw_light_panel(ui: UiFrame) -> None:
    """All of it; what lights is shown where it has an effect."""
    view = ui.session.view.material_view
    _label("view", "What of the materials is shown: surfaces in the light, or one of their maps")
    chosen = combo("materials", view, get_args(MaterialView), ui.rects)
    if chosen != view:
        ui.emit("materials.view", chosen)
    if view != "base":
        _draw_decoded_maps(ui)
    if view == "lit":
        _draw_light(ui)
    else:
        imgui.text_disabled(VIEWS[view])
