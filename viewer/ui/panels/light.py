"""Panel "Light": the view of the materials, and the light of the scene."""

from pathlib import Path

from imgui_bundle import imgui

from viewer.state.setting import field_text
from viewer.state.view_state import BUILTIN_ENVIRONMENTS, REFERENCE, SKY, VIEWS, Lighting
from viewer.ui.controls import control
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import combo, labelled, wrapped_disabled


def _labelled(ui: UiFrame, text: str, command_id: str, *chosen: str, label: str = "") -> None:
    """Draw a label with the widget of a command."""
    labelled(text)
    control(ui, command_id, *chosen, label=label or text, width=-1.0)


def _draw_environment(ui: UiFrame) -> None:
    environment = ui.session.view.lighting.environment
    labelled("environment")
    imgui.set_next_item_width(-1.0)
    shown = Path(environment).name
    tip = f"{field_text(Lighting, 'environment')} You can drop a panorama on the window."
    chosen = combo("environment", shown, tuple(dict.fromkeys((*BUILTIN_ENVIRONMENTS, shown))), ui.rects, tip)
    if chosen != shown:
        ui.emit("light.environment", Path(chosen))
    if environment != SKY:
        _labelled(ui, "turned by", "light.turn")


def _draw_light(ui: UiFrame) -> None:
    _draw_environment(ui)
    _labelled(ui, "sun from", "light.sun-azimuth")
    _labelled(ui, "sun height", "light.sun-elevation")
    _labelled(ui, "sun", "light.sun-strength")
    _labelled(ui, "exposure", "light.exposure")
    _labelled(ui, "tone map", "light.tone-map")
    wrapped_disabled("Shift + drag over the picture moves the sun.")


def draw_light_panel(ui: UiFrame) -> None:
    """Draw the content of the panel. Controls of light appear only in the view `lit`."""
    view = ui.session.view.material_view
    _labelled(ui, "view", "materials.view", label="materials")
    if view != "base":
        for side, slot in ui.session.view.slots.items():
            if slot.source != REFERENCE:
                _labelled(ui, f"{side.upper()} decodes", "slot.maps", side, label=f"{side.upper()} maps")
    if view == "lit":
        _draw_light(ui)
    else:
        wrapped_disabled(VIEWS[view])
