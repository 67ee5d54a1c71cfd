"""The reflection of a surface in float64: metallic-roughness as in glTF 2.0, appendix B, with KHR_materials_ior and _specular.

Single scattering is GGX with height-correlated Smith masking and Schlick's Fresnel term. It loses light on rough surfaces, which
further scattering between microfacets would return. That light is added: for environments after Fdez-Agüera 2019, "A
Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting"; for single lights after Turquin 2019, "Practical multiple
scattering compensation for microfacet models". shaders/lighting/brdf.glsl computes the same.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from viewer.lighting.directions import Array, sample_bilinear

SMALLEST_ROUGHNESS: Final = 0.045
"""Smallest roughness in reflections of single lights (alpha 0.002): a perfect mirror would never show a light without size."""
SMALLEST_COSINE: Final = 1e-4
"""Smallest cosine to the viewer. Interpolated normals may face away from the viewer; they count as grazing."""
TABLE_SIDE: Final = 64
TABLE_SAMPLES: Final = 256
CLEARCOAT_F0: Final = 0.04


@dataclass(frozen=True, eq=False)
class Reflection:
    """Reflection of N surfaces, maps and factors multiplied: metals and dielectrics, mixed by `metalness`."""

    diffuse: Array
    """[N, 3] linear albedo of the diffuse layer below a dielectric's surface, without the transmitted share."""
    metal: Array
    """[N, 3] reflectance of the metal at normal incidence; 1 at grazing angles."""
    dielectric: Array
    """[N, 3] reflectance of the dielectric's surface at normal incidence."""
    dielectric_grazing: Array
    """[N, 1] reflectance of the dielectric's surface at grazing angles."""
    metalness: Array
    """[N, 1] share of metal in [0, 1]."""
    roughness: Array
    """[N, 1] perceptual roughness in [0, 1]."""


def reflection_of(
    base: Array,
    metalness: Array,
    roughness: Array,
    ior: Array,
    specular: Array,
    specular_color: Array,
    transmission: Array,
) -> Reflection:
    """Return the reflection of surfaces: `base`, `specular_color` [N, 3] linear; all others [N, 1]."""
    reflectance = ((ior - 1.0) / (ior + 1.0)) ** 2
    dielectric = np.minimum(reflectance * specular_color, 1.0) * specular
    return Reflection(base * (1.0 - transmission), base, dielectric, specular, metalness, roughness)


def dot(a: Array, b: Array) -> Array:
    """Return [..., 1] scalar products of vectors [..., 3]."""
    return np.asarray(np.sum(a * b, axis=-1, keepdims=True))


def normalized(vectors: Array) -> Array:
    """Return vectors [..., 3] scaled to length 1; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30))


def ggx(half_cosine: Array, alpha: Array) -> Array:
    """Return the distribution of microfacet normals D (Walter et al. 2007) at the cosine between normal and half vector."""
    spread = half_cosine**2 * (alpha**2 - 1.0) + 1.0
    return np.asarray(alpha**2 / (np.pi * spread**2))


def smith(view_cosine: Array, light_cosine: Array, alpha: Array) -> Array:
    """Return the height-correlated visibility V = G / (4 NoL NoV) (Heitz 2014)."""
    a2 = alpha**2
    view = light_cosine * np.sqrt(view_cosine**2 * (1.0 - a2) + a2)
    light = view_cosine * np.sqrt(light_cosine**2 * (1.0 - a2) + a2)
    return np.asarray(0.5 / np.maximum(view + light, 1e-30))


def hammersley(count: int) -> Array:
    """Return [count, 2] points in [0, 1): (i / count, bits of i reversed), `count` up to 65536."""
    numbers = np.arange(count)
    reversed_bits = np.zeros(count)
    for bit in range(16):
        reversed_bits += ((numbers >> bit) & 1) * 0.5 ** (bit + 1)
    return np.stack([numbers / count, reversed_bits], axis=-1)


def half_vectors(points: Array, alpha: Array) -> Array:
    """Return [..., 3] half vectors around (0, 0, 1), drawn from GGX by `points` [..., 2] in [0, 1)."""
    cosine = np.sqrt((1.0 - points[..., 0]) / (1.0 + (alpha**2 - 1.0) * points[..., 0]))
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    turn = 2.0 * np.pi * points[..., 1]
    return np.stack(np.broadcast_arrays(sine * np.cos(turn), sine * np.sin(turn), cosine), axis=-1)


@lru_cache(maxsize=2)
def brdf_table(side: int = TABLE_SIDE, samples: int = TABLE_SAMPLES) -> Array:
    """Return [side, side, 2]: directional albedo of the specular lobe as f0 * table[..., 0] + f90 * table[..., 1].

    Rows: roughness, columns: cosine to the viewer, both at (index + 0.5) / side.

    Split sum (Karis 2013, "Real Shading in Unreal Engine 4"): the reflection of an environment is approximately the product of two
    integrals, the prefiltered radiance (`viewer.lighting.prefilter`) and the lobe's albedo in this table. Schlick's Fresnel term
    F = f0 + (f90 - f0) (1 - VoH)^5 is linear in f0 and f90, therefore two columns suffice for all materials. The estimator draws half
    vectors from GGX; dividing by their density leaves the weight 4 V NoL VoH / NoH.
    """
    places = (np.arange(side) + 0.5) / side
    view = np.stack([np.sqrt(1.0 - places**2), np.zeros(side), places], axis=-1)[:, None, :]
    table = np.zeros((side, side, 2))
    for row, roughness in enumerate(places):
        alpha = np.array(roughness**2)
        halves = half_vectors(hammersley(samples), alpha)
        view_half = np.maximum(dot(view, halves)[..., 0], 0.0)
        light = 2.0 * view_half * halves[..., 2] - view[..., 2]
        lit = light > 0.0
        weight = smith(view[..., 2], np.maximum(light, 0.0), alpha) * 4.0 * np.maximum(light, 0.0) * view_half
        weight = np.where(lit, weight / np.maximum(halves[..., 2], 1e-30), 0.0)
        grazing = (1.0 - view_half) ** 5
        table[row, :, 0] = np.mean((1.0 - grazing) * weight, axis=1)
        table[row, :, 1] = np.mean(grazing * weight, axis=1)
    table.flags.writeable = False
    return table


def table_lookup(table: Array, view_cosine: Array, roughness: Array) -> tuple[Array, Array]:
    """Sample both columns of `table` [side, side, 2] at [N, 1] cosines and roughnesses, as a clamped texture with a linear filter."""
    side = table.shape[0]
    albedo = sample_bilinear(table, view_cosine[..., 0] * side, roughness[..., 0] * side)
    return albedo[:, :1], albedo[:, 1:]


def light_response(surface: Reflection, table: tuple[Array, Array], normal: Array, view: Array, light: Array) -> Array:
    """Return [N, 3] radiance towards `view` for irradiance 1 on a surface that faces `light`; both are unit vectors [N, 3]."""
    light_cosine = dot(normal, light)
    view_cosine = np.clip(dot(normal, view), SMALLEST_COSINE, 1.0)
    half = normalized(view + light)
    half_cosine, view_half = np.clip(dot(normal, half), 0.0, 1.0), np.clip(dot(view, half), 0.0, 1.0)
    alpha = np.maximum(surface.roughness, SMALLEST_ROUGHNESS) ** 2
    lobe = ggx(half_cosine, alpha) * smith(view_cosine, np.maximum(light_cosine, 0.0), alpha)
    grazing = (1.0 - view_half) ** 5
    metal = surface.metal + (1.0 - surface.metal) * grazing
    dielectric = surface.dielectric + (surface.dielectric_grazing - surface.dielectric) * grazing
    lost = 1.0 / np.maximum(table[0] + table[1], 1e-3) - 1.0
    mirrored = (
        dielectric * (1.0 + surface.dielectric * lost) * (1.0 - surface.metalness)
        + metal * (1.0 + surface.metal * lost) * surface.metalness
    )
    passed = (1.0 - dielectric.max(axis=-1, keepdims=True)) * (1.0 - surface.metalness)
    result = surface.diffuse * passed / np.pi + mirrored * lobe
    return np.asarray(np.where(light_cosine > 0.0, result * light_cosine, 0.0))


def _scattering(f0: Array, f90: Array, table: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the directional albedo of the specular lobe: that of single scattering, and that of all further scattering.

    Fdez-Agüera 2019, Sec. 2: single scattering of a white surface returns E = table[0] + table[1], so that 1 - E is scattered
    again. Each further bounce reflects `average`, Schlick's term averaged over the hemisphere (f0 + (f90 - f0) / 21), and again
    loses 1 - E. The geometric series of the bounces sums to the second value.
    """
    lost = 1.0 - (table[0] + table[1])
    single = f0 * table[0] + f90 * table[1]
    average = f0 + (f90 - f0) / 21.0
    return single, lost * single * average / (1.0 - average * lost)


def environment_response(surface: Reflection, table: tuple[Array, Array], specular: Array, irradiance: Array) -> Array:
    """Return the [N, 3] radiance of an environment that a surface reflects towards the viewer.

    `specular`: [N, 3] prefiltered radiance around the mirrored view; `irradiance`: [N, 3] irradiance over pi around the normal.
    """
    single, multiple = _scattering(surface.dielectric, surface.dielectric_grazing, table)
    metal_single, metal_multiple = _scattering(surface.metal, np.ones((1, 1)), table)
    passed = 1.0 - (single + multiple).max(axis=-1, keepdims=True)
    share = surface.metalness
    mirrored = specular * (single + (metal_single - single) * share)
    scattered = (multiple + surface.diffuse * passed) * (1.0 - share) + metal_multiple * share
    return np.asarray(mirrored + irradiance * scattered)


def clearcoat_fresnel(view_cosine: Array) -> Array:
    """Return [N, 1] the reflectance of a clear coat of ior 1.5 (Schlick)."""
    return np.asarray(CLEARCOAT_F0 + (1.0 - CLEARCOAT_F0) * (1.0 - view_cosine) ** 5)
