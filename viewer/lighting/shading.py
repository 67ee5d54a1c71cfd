"""Shading of surfaces in float64: the slow twin of shaders/passes/shade. docs/explanation/lighting.md describes the model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viewer.lighting.brdf import (
    CLEARCOAT_F0,
    SMALLEST_COSINE,
    Reflection,
    brdf_table,
    clearcoat_fresnel,
    dot,
    environment_response,
    light_response,
    normalized,
    reflection_of,
    table_lookup,
)
from viewer.lighting.directions import Array, turned
from viewer.lighting.prefilter import PrefilteredEnvironment, around
from viewer.scene.model import Light, SurfaceFactors

SMALLEST_TANGENT: Final = 1e-4
"""Smallest length of a tangent's part across the normal. A shorter tangent is replaced by any direction across the normal."""


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of N places on surfaces, with maps as the planes hold them (ntc.codec.maps), before the material's factors."""

    factors: Sequence[SurfaceFactors]
    """Factors of the material of each place."""
    base: Array
    """[N, 3] linear base colour, factor and vertex colour multiplied in."""
    surface: Array
    """[N, 4] normal x and y as (n + 1) / 2, roughness, metalness."""
    emission: Array
    """[N, 4] linear emissive RGB, occlusion."""
    normals: Array
    """[N, 3] interpolated normals, world space, on the visible side."""
    tangents: Array
    """[N, 4] interpolated tangents, world space, and the sign of the bitangents."""
    positions: Array
    """[N, 3] world space."""
    views: Array
    """[N, 3] unit vectors to the viewer."""
    unlit: Sequence[bool] = ()
    """Flags of the places whose material is unlit; empty where none is."""


@dataclass(frozen=True, eq=False)
class LightSources:
    """Light sources of a scene."""

    environment: PrefilteredEnvironment
    turn: float = 0.0
    """Turn of the environment in degrees from north towards east."""
    sun_direction: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Unit vector towards the sun."""
    sun_irradiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Linear RGB irradiance of a surface that faces the sun."""
    lights: tuple[Light, ...] = ()


def shading_normals(normals: Array, tangents: Array, stored: Array, scale: Array) -> Array:
    """Return [N, 3] unit normals of a normal map in the frame of `normals` [N, 3] and `tangents` [N, 4] (glTF 2.0, Sec. 3.9.3).

    `stored`: [N, 2] x and y as (n + 1) / 2; z is rebuilt. `scale`: [N, 1] multiplies x and y. The result has length 1 for any input: a
    tangent of length zero or along the normal is replaced, and a mapped normal of length zero becomes the surface's normal.
    """
    normal = normalized(normals)
    normal = np.where(dot(normal, normal) < 0.5, [0.0, 1.0, 0.0], normal)
    across = tangents[:, :3] - normal * dot(normal, tangents[:, :3])
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    any_across = around(normal, np.broadcast_to([1.0, 0.0, 0.0], normal.shape))
    tangent = np.where(length > SMALLEST_TANGENT, across / np.maximum(length, 1e-30), any_across)
    bitangent = np.cross(normal, tangent) * np.where(tangents[:, 3:] < 0.0, -1.0, 1.0)
    xy = stored * 2.0 - 1.0
    z = np.sqrt(np.maximum(1.0 - dot(xy, xy), 0.0))
    xy = xy * scale
    mapped = tangent * xy[:, :1] + bitangent * xy[:, 1:] + normal * z
    return np.asarray(np.where(dot(mapped, mapped) > 1e-8, normalized(mapped), normal))


def _factor(samples: SurfaceSamples, name: str) -> Array:
    values = np.array([getattr(factors, name) for factors in samples.factors], np.float64)
    return values.reshape(len(samples.factors), -1)


def light_at(light: Light, positions: Array) -> tuple[Array, Array]:
    """Return ([N, 3] unit vectors from `positions` [N, 3] to `light`, [N, 3] irradiance there of a surface that faces the light).

    Falloff and cones are those of KHR_lights_punctual.
    """
    color = np.array(light.color)
    if light.kind == "directional":
        towards = -normalized(np.array(light.direction, np.float64))
        return np.broadcast_to(towards, positions.shape), np.broadcast_to(color, positions.shape)
    offset = np.array(light.position) - positions
    distance2 = np.maximum(dot(offset, offset), 1e-6)
    towards = offset / np.sqrt(distance2)
    strength = 1.0 / distance2
    if light.reach > 0.0:
        strength = strength * np.clip(1.0 - (distance2 / light.reach**2) ** 2, 0.0, 1.0)
    if light.kind == "spot":
        scale = 1.0 / max(0.001, math.cos(light.inner_cone) - math.cos(light.outer_cone))
        cosine = dot(normalized(np.array(light.direction, np.float64)), -towards)
        strength = strength * np.clip((cosine - math.cos(light.outer_cone)) * scale, 0.0, 1.0) ** 2
    return towards, strength * color


def _environment(sources: LightSources, directions: Array) -> Array:
    return turned(directions, -sources.turn)


@dataclass(frozen=True, eq=False)
class _Lobes:
    """Surface with its BRDF table entries and the normal that they belong to."""

    surface: Reflection
    table: tuple[Array, Array]
    normals: Array

    @staticmethod
    def of(surface: Reflection, normals: Array, views: Array) -> "_Lobes":
        cosine = np.clip(dot(normals, views), SMALLEST_COSINE, 1.0)
        return _Lobes(surface, table_lookup(brdf_table(), cosine, surface.roughness), normals)

    def environment(self, sources: LightSources, views: Array) -> Array:
        mirrored = 2.0 * dot(self.normals, views) * self.normals - views
        specular = sources.environment.specular(_environment(sources, mirrored), self.surface.roughness)
        diffuse = sources.environment.irradiance(_environment(sources, self.normals))
        return environment_response(self.surface, self.table, specular, diffuse)

    def lights(self, sources: LightSources, samples: SurfaceSamples, sun_share: Array) -> Array:
        sun = np.broadcast_to(np.array(sources.sun_direction, np.float64), self.normals.shape)
        strength = np.array(sources.sun_irradiance) * sun_share
        total = light_response(self.surface, self.table, self.normals, samples.views, sun) * strength
        for light in sources.lights:
            towards, received = light_at(light, samples.positions)
            total = total + light_response(self.surface, self.table, self.normals, samples.views, towards) * received
        return np.asarray(total)


def shade(samples: SurfaceSamples, sources: LightSources, sun_share: Array | None = None) -> Array:
    """Return [N, 3] linear radiance towards the viewer, before exposure and tone map; for unlit materials, their base colour.

    `sun_share`: [N, 1] share of the sun that is not in shadow at each place; None is 1 everywhere.
    """
    roughness = np.clip(samples.surface[:, 2:3] * _factor(samples, "roughness"), 0.0, 1.0)
    metalness = np.clip(samples.surface[:, 3:4] * _factor(samples, "metalness"), 0.0, 1.0)
    surface = reflection_of(
        samples.base,
        metalness,
        roughness,
        _factor(samples, "ior"),
        _factor(samples, "specular"),
        _factor(samples, "specular_color"),
        _factor(samples, "transmission"),
    )
    scale, stored = _factor(samples, "normal_scale"), samples.surface[:, :2]
    normals = shading_normals(samples.normals, samples.tangents, stored, scale)
    occlusion = 1.0 + _factor(samples, "occlusion_strength") * (samples.emission[:, 3:] - 1.0)
    share = np.ones((len(samples.base), 1)) if sun_share is None else sun_share
    lobes = _Lobes.of(surface, normals, samples.views)
    emitted = samples.emission[:, :3] * _factor(samples, "emissive")
    radiance = lobes.environment(sources, samples.views) * occlusion + lobes.lights(sources, samples, share) + emitted
    coat = _factor(samples, "clearcoat")
    if coat.any():
        zero, one = np.zeros((len(coat), 3)), np.ones((len(coat), 1))
        # Normal maps of clear coats are not drawn: the coat follows the geometric normal.
        coat_normals = normalized(samples.normals)
        layer_factors = one, one * 0.0, _factor(samples, "clearcoat_roughness")
        clear = Reflection(zero, zero, zero + CLEARCOAT_F0, *layer_factors)
        layer = _Lobes.of(clear, coat_normals, samples.views)
        reflected = layer.environment(sources, samples.views) * occlusion + layer.lights(sources, samples, share)
        radiance = radiance * (
            1.0 - coat * clearcoat_fresnel(np.clip(dot(coat_normals, samples.views), SMALLEST_COSINE, 1.0))
        )
        radiance = radiance + coat * reflected
    unlit = np.array(samples.unlit or [False] * len(samples.base), bool)[:, None]
    return np.asarray(np.where(unlit, samples.base, radiance))
