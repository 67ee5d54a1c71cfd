"""All that lights a view, as the shading pass reads it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.sun import Sun
from viewer.render.pass_scheduler import Output
from viewer.render.resources.layout import MOST_LIGHTS
from viewer.render.resources.light.environment_maps import EnvironmentMaps
from viewer.render.resources.light.shadow_map import ShadowMap, ShadowView
from viewer.scene.model import Light, Material, SurfaceFactors
from viewer.state.view_state import ToneMap

LIGHT_RECORD = np.dtype(
    [("color", "<f4", (4,)), ("position", "<f4", (4,)), ("direction", "<f4", (4,)), ("cone", "<f4", (4,))]
)
"""A light: std140, 64 bytes, see shaders/lighting/lights.glsl."""


@dataclass(frozen=True)
class SurfaceKinds:
    """What any material of a scene has: shaders leave out what none has, for every pixel costs what its shader could need."""

    clearcoat: bool = False
    specular: bool = True
    """Another reflectance than that of ior 1.5, or transmission."""
    emissive: bool = True
    unlit: bool = True

    @staticmethod
    def of(materials: Sequence[Material]) -> "SurfaceKinds":
        """Of all `materials`."""
        factors = [material.factors for material in materials]
        plain = SurfaceFactors()
        return SurfaceKinds(
            any(own.clearcoat > 0.0 for own in factors),
            any(
                (own.ior, own.specular, own.specular_color, own.transmission)
                != (plain.ior, plain.specular, plain.specular_color, plain.transmission)
                for own in factors
            ),
            any(max(own.emissive) > 0.0 for own in factors),
            any(material.unlit for material in materials),
        )

    def defines(self) -> dict[str, int]:
        """Defines of shaders/passes/shade/shade.frag."""
        return {
            "CLEARCOAT": int(self.clearcoat),
            "SPECULAR": int(self.specular),
            "EMISSIVE": int(self.emissive),
            "UNLIT": int(self.unlit),
        }


@dataclass(frozen=True)
class SceneLight:
    """Equal values light a scene alike."""

    environment_key: str
    """Says which environment the maps show."""
    turn: float
    """Degrees that it is turned by, from north towards east."""
    sun: Sun
    shows_sun: bool
    """Whether the sun's disk is drawn in front of the environment."""
    exposure: float
    """In stops."""
    tone_map: ToneMap
    environment: EnvironmentMaps = field(compare=False)
    shadow: ShadowMap | None = None
    """None where nothing casts shadows. What it shows follows from the sun."""
    shadow_view: ShadowView | None = field(default=None, compare=False)
    lights: tuple[Light, ...] = ()
    kinds: SurfaceKinds = SurfaceKinds()
    outputs: tuple[Output, ...] = field(default=(), compare=False)
    """Of the environment and the shadow map."""


def light_records(lights: tuple[Light, ...], eye: NDArray[np.float64]) -> NDArray[np.void]:
    """[MOST_LIGHTS] LIGHT_RECORD of the first MOST_LIGHTS lights, their places relative to `eye` [3]."""
    records = np.zeros(MOST_LIGHTS, LIGHT_RECORD)
    for record, light in zip(records, lights, strict=False):
        axis = np.array(light.direction, np.float64)
        axis /= max(float(np.linalg.norm(axis)), 1e-30)
        record["color"][:3] = light.color
        record["direction"][:3] = axis
        if light.kind == "directional":
            record["position"][:3] = -axis
            continue
        record["position"] = (*(np.array(light.position) - eye), 1.0)
        record["color"][3] = 1.0 / light.reach**2 if light.reach > 0.0 else 0.0
        # Without a cone: 0 times the cosine, plus 1.
        scale, offset = 0.0, 1.0
        if light.kind == "spot":
            scale = 1.0 / max(0.001, math.cos(light.inner_cone) - math.cos(light.outer_cone))
            offset = -math.cos(light.outer_cone) * scale
        record["cone"][0], record["direction"][3] = scale, offset
    return records
