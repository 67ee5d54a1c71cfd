"""Commands: what of the materials is shown, and the light that they are shown in."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from viewer.commands.command import Arg, Context, command, following, gesture
from viewer.commands.effects import Effect, ReadVariant
from viewer.lighting.panorama import load_panorama
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.view_state import (
    ELEVATION_RANGE,
    EXPOSURE_RANGE,
    OWN_ENVIRONMENTS,
    SKY,
    SUN_STRENGTH_RANGE,
    MaterialView,
    ToneMap,
)

VIEWS: dict[MaterialView, str] = {
    "lit": "lit surfaces",
    "base": "base colours without light",
    "normal": "normal maps as stored",
    "orm": "occlusion, roughness and metalness as red, green and blue",
    "emissive": "emitted light",
}
"""Description of each view in a few words."""

OWN_MATERIALS = "default"
"""Name of the variant in which primitives have their own materials."""


def _light(session: Session, **changes: Any) -> None:
    session.view = replace(session.view, lighting=replace(session.view.lighting, **changes))


@command(
    "materials.next",
    "Next material view",
    "show the next view: lit, base colour, normals, roughness and metalness, emission",
    "View",
    "G",
)
def next_view(session: Session) -> None:
    view = following(tuple(VIEWS), session.view.material_view)
    session.view = replace(session.view, material_view=view)
    notify(session, f"{view}: {VIEWS[view]}")


@command(
    "materials.view",
    "Material view",
    "show lit surfaces, or one of the maps",
    "View",
    current=lambda session: session.view.material_view,
)
def set_view(session: Session, view: Annotated[MaterialView, Arg("what is shown")]) -> None:
    session.view = replace(session.view, material_view=view)


def _no_variants(context: Context) -> str:
    return "" if context.session.scene.variants else "the scene has no material variants"


Variant = Annotated[
    str, Arg(f"a variant of the scene's materials, or {OWN_MATERIALS}", lambda s: (OWN_MATERIALS, *s.scene.variants))
]


@command(
    "materials.variant",
    "Material variant",
    "draw the scene in another of its material variants",
    "View",
    unavailable=_no_variants,
    current=lambda session: session.scene.variant or OWN_MATERIALS,
)
def set_variant(session: Session, name: Variant) -> Effect:
    own = name == OWN_MATERIALS and name not in session.scene.variants
    return ReadVariant("" if own else name)


@command("light.sun", "Sun direction", "set azimuth and elevation of the sun", "View")
def set_sun(
    session: Session,
    azimuth: Annotated[float, Arg("degrees from north (-Z) towards east (+X)")],
    elevation: Annotated[float, Arg("degrees above the horizon", None, *ELEVATION_RANGE, clamp=True)],
) -> None:
    _light(session, sun_azimuth=azimuth % 360.0, sun_elevation=elevation)


@gesture("light.move-sun")
def move_sun(session: Session, azimuth: float, elevation: float) -> None:
    """Turn the sun by these angles, in degrees."""
    lighting = session.view.lighting
    low, high = ELEVATION_RANGE
    raised = min(max(lighting.sun_elevation + elevation, low), high)
    _light(session, sun_azimuth=(lighting.sun_azimuth + azimuth) % 360.0, sun_elevation=raised)


@command(
    "light.sun-strength",
    "Sun strength",
    "set the strength of the sun: 1 is the usual one, 0 turns it off",
    "View",
)
def set_sun_strength(
    session: Session, strength: Annotated[float, Arg("factor, 0 to 20", None, *SUN_STRENGTH_RANGE)]
) -> None:
    _light(session, sun_strength=strength)


@command("light.exposure", "Exposure", "make the lit picture brighter or darker", "View")
def set_exposure(
    session: Session, stops: Annotated[float, Arg("stops: +1 is twice as bright", None, *EXPOSURE_RANGE)]
) -> None:
    _light(session, exposure=stops)


@command(
    "light.tone-map",
    "Tone map",
    "choose how light is mapped to the colours of the screen",
    "View",
    current=lambda session: session.view.lighting.tone_map,
)
def set_tone_map(
    session: Session, curve: Annotated[ToneMap, Arg("Khronos PBR Neutral, AgX, or only clipping")]
) -> None:
    _light(session, tone_map=curve)


def use_environment(session: Session, file: Path) -> None:
    """Light the scene by the panorama in `file`. Raises InputError for a file that cannot be used; the light then stays."""
    path = session.file_to_read(file)
    load_panorama(path)
    # A panorama has lights of its own.
    _light(session, environment=str(path), sun_strength=0.0)
    notify(session, f"lit by {path.name} alone; the sun is off")


@command("light.environment", "Environment", "light the scene by the sky, by a studio, or by a panorama", "View")
def set_environment(
    session: Session,
    file: Annotated[Path, Arg("`sky`, `studio`, or an equirectangular .hdr or .exr")],
) -> None:
    if str(file) in OWN_ENVIRONMENTS:
        _light(session, environment=str(file), sun_strength=float(str(file) == SKY))
        return
    use_environment(session, file)


@command("light.turn", "Turn environment", "turn the panorama about the vertical axis; the sky stays", "View")
def turn_environment(session: Session, degrees: Annotated[float, Arg("degrees")]) -> None:
    _light(session, environment_turn=degrees % 360.0)
