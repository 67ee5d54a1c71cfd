"""A scene's materials as shaders read them: factors, and for each plane of maps where its texture is."""

import numpy as np

from ntc.codec.gpu import WRAP_CODES
from ntc.codec.maps import MAP_CHANNELS, PLANE_COMPONENTS, PLANES, MapName, Plane
from viewer.render.resources.layout import ALPHA_CODES, MATERIAL_RECORD, sampler_flags
from viewer.scene.model import Material, Scene

COMPONENTS_OF_MAP: dict[MapName, int] = {**MAP_CHANNELS, "base": 4}
"""Components of a plane that each map takes."""


def component_bits(plane: Plane, maps: tuple[MapName, ...]) -> int:
    """A bit for each of the plane's four components that `maps` take."""
    places = PLANE_COMPONENTS[plane]
    taken = [range(places[name], places[name] + COMPONENTS_OF_MAP[name]) for name in maps if name in places]
    return sum(1 << component for part in taken for component in part)


def dielectric_reflectance(material: Material) -> tuple[float, float, float, float]:
    """Reflectance of the material where it is no metal: linear RGB at normal incidence, and at grazing incidence.

    KHR_materials_ior and KHR_materials_specular.
    """
    factors = material.factors
    plain = ((factors.ior - 1.0) / (factors.ior + 1.0)) ** 2 if factors.ior > 0.0 else 1.0
    red, green, blue = (min(plain * color, 1.0) * factors.specular for color in factors.specular_color)
    return red, green, blue, factors.specular


def material_records(scene: Scene) -> np.ndarray:
    """[materials] MATERIAL_RECORD; `image_array` and `image_layer` of planes are left to the reference pass."""
    records = np.zeros(max(1, len(scene.materials)), MATERIAL_RECORD)
    records["planes"]["uv_u"][..., 0] = records["planes"]["uv_v"][..., 1] = 1.0
    records["planes"]["texture_id"] = records["planes"]["image_array"] = -1
    for record, material in zip(records, scene.materials, strict=False):
        factors = material.factors
        record["factor"] = material.factor
        record["emissive"] = (*factors.emissive, factors.occlusion_strength)
        record["surface"] = (factors.roughness, factors.metalness, factors.normal_scale, factors.transmission)
        record["specular"] = dielectric_reflectance(material)
        record["alpha_cutoff"] = material.alpha_cutoff
        record["alpha_mode"] = ALPHA_CODES[material.alpha_mode]
        record["unlit"] = material.unlit
        record["clearcoat"], record["clearcoat_roughness"] = factors.clearcoat, factors.clearcoat_roughness
        for own, plane in zip(record["planes"], PLANES, strict=True):
            # Coverage is read as the base colour would be, also where there is none.
            own["wrap_u"], own["wrap_v"] = (WRAP_CODES[mode] for mode in material.sampler.wrap)
            found = material.plane(plane)
            if found is None:
                continue
            own["texture_id"] = found.texture_id
            own["wrap_u"], own["wrap_v"] = (WRAP_CODES[mode] for mode in found.sampler.wrap)
            own["sampler_flags"] = sampler_flags(found.sampler)
            own["components"] = component_bits(plane, found.maps)
            own["second_uvs"] = found.second_uvs
            own["uv_u"][:3], own["uv_v"][:3] = found.uv_transform[:3], found.uv_transform[3:]
    return records
