"""Commands for materials and light: the view of the materials, their variant, the sun, the environment and the tone map."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from viewer.commands.command import Arg, command, field_command, gesture, next_command, unless
from viewer.commands.effects import Effect, ReadVariant
from viewer.lighting.panorama import load_panorama
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.setting import field_args
from viewer.state.view_state import BUILTIN_ENVIRONMENTS, SKY, VIEWS, Azimuth, Elevation, Lighting

DEFAULT_VARIANT = "default"
"""Name of the variant in which primitives have the materials that they name themselves."""


def _light(session: Session, **changes: Any) -> None:
    session.view = replace(session.view, lighting=replace(session.view.lighting, **changes))


view = field_command("view.material_view")
next_view = next_command(
    view,
    "materials.next",
    "Next material view",
    "show the next view: lit, base colour, normals, roughness and metalness, emission",
    "G",
    lambda view: f"{view}: {VIEWS[view]}",
)


Variant = Annotated[
    str,
    Arg(f"a variant of the scene's materials, or {DEFAULT_VARIANT}", lambda s: (DEFAULT_VARIANT, *s.scene.variants)),
]


@command(
    "materials.variant",
    "Material variant",
    "draw the scene in another of its material variants",
    unavailable=unless(lambda context: context.session.scene.variants, "the scene has no material variants"),
    current=lambda session: session.scene.variant or DEFAULT_VARIANT,
)
def set_variant(session: Session, name: Variant) -> Effect:
    is_default = name == DEFAULT_VARIANT and name not in session.scene.variants
    return ReadVariant("" if is_default else name)


@command("light.sun", "Sun direction", "set azimuth and elevation of the sun")
def set_sun(session: Session, azimuth: Azimuth, elevation: Elevation) -> None:
    _light(session, sun_azimuth=azimuth, sun_elevation=elevation)


sun_azimuth = field_command("view.lighting.sun_azimuth")
sun_elevation = field_command("view.lighting.sun_elevation")


@gesture("light.move-sun")
def move_sun(session: Session, azimuth: float, elevation: float) -> None:
    """Move the sun by these angles, in degrees."""
    lighting = session.view.lighting
    moved = (lighting.sun_azimuth + azimuth, lighting.sun_elevation + elevation)
    set_sun.function(session, *(p.checked(value, session) for p, value in zip(set_sun.parameters, moved, strict=True)))


sun_strength = field_command("view.lighting.sun_strength")
exposure = field_command("view.lighting.exposure")
tone_map = field_command("view.lighting.tone_map")


def use_environment(session: Session, file: Path) -> None:
    """Light the scene by the panorama in `file`. Raises InputError for an unusable file; the light then stays unchanged."""
    path = session.file_to_read(file)
    load_panorama(path)
    # The panorama contains its lights.
    _light(session, environment=str(path), sun_strength=0.0)
    notify(session, f"lit by {path.name} alone; the sun is off")


@command(
    "light.environment", "Environment", "light the scene by the sky, by a studio, or by a panorama", icon="lightbulb"
)
def set_environment(session: Session, file: Annotated[Path, field_args(Lighting)["environment"]]) -> None:
    if str(file) in BUILTIN_ENVIRONMENTS:
        _light(session, environment=str(file), sun_strength=float(str(file) == SKY))
        return
    use_environment(session, file)


turn = field_command("view.lighting.environment_turn")
