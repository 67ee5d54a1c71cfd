"""The factors of a material: how its surface answers light where no map tells it, and what multiplies the maps."""

from typing import Any

from viewer.scene.gltf.container import GltfFile
from viewer.scene.model import SurfaceFactors
from viewer.scene.report import ReportNotes

NORMAL_REFLECTANCE = 0.04
"""Of a dielectric of index 1.5, which KHR_materials_pbrSpecularGlossiness has none of its own for."""
LARGEST = 1e6
"""Strengths and indices above it are taken to be it."""

_LEFT_OUT = {
    "KHR_materials_specular": ("specularTexture", "specularColorTexture"),
    "KHR_materials_clearcoat": ("clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"),
    "KHR_materials_transmission": ("transmissionTexture",),
}
"""Textures of extensions whose factors are read."""


class _Factors:
    """Numbers of one material, held within what the specification allows them."""

    def __init__(self, file: GltfFile, entry: dict[str, Any], where: str, notes: ReportNotes) -> None:
        self._file = file
        self._entry = entry
        self._where = where
        self._notes = notes

    def extension(self, name: str) -> tuple[dict[str, Any], str]:
        """(the extension `name`, or an empty object; the field it stands in)."""
        found = self._file.extension(self._entry, name, self._where)
        if found is not None:
            self._notes.honoured(f"{name}: materials")
            for key in _LEFT_OUT.get(name, ()):
                self._notes.ignored(f"{name}: {key}", int(key in found))
        return found or {}, f"{self._where}.{name}"

    def number(
        self, owner: dict[str, Any], key: str, where: str, default: float, low: float = 0.0, high: float = 1.0
    ) -> float:
        """`owner[key]`, at least `low` and at most `high`."""
        return self._within(self._file.number(owner, key, where, default), low, high)

    def color(
        self, owner: dict[str, Any], key: str, where: str, default: float, high: float
    ) -> tuple[float, float, float]:
        """Linear RGB `owner[key]`, each from 0 to `high`."""
        red, green, blue = self._file.numbers(owner, key, where, (default, default, default))
        return self._within(red, 0.0, high), self._within(green, 0.0, high), self._within(blue, 0.0, high)

    def _within(self, value: float, low: float, high: float) -> float:
        held = min(max(value, low), high)
        self._notes.note("factors out of range, brought into it", int(held != value))
        return held


def read_factors(file: GltfFile, entry: dict[str, Any], where: str, notes: ReportNotes) -> SurfaceFactors:
    """Those of the material `entry` (glTF 2.0, Sec. 3.9, and the KHR_materials extensions). Raises InputError.

    Of specular-glossiness materials metalness is 0, the specular colour that of the reflection at normal incidence, and
    roughness 1 - glossiness; where a texture gives both, it is not read, and roughness is 1.
    """
    factors = _Factors(file, entry, where, notes)
    pbr, pbr_name = file.object(entry, "pbrMetallicRoughness", where), f"{where}.pbrMetallicRoughness"
    normal, occlusion = file.object(entry, "normalTexture", where), file.object(entry, "occlusionTexture", where)
    strength, name = factors.extension("KHR_materials_emissive_strength")
    glow = factors.number(strength, "emissiveStrength", name, 1.0, high=LARGEST)
    red, green, blue = factors.color(entry, "emissiveFactor", where, 0.0, 1.0)
    ior, name = factors.extension("KHR_materials_ior")
    index = factors.number(ior, "ior", name, 1.5, high=LARGEST)
    specular, name = factors.extension("KHR_materials_specular")
    reflection = factors.number(specular, "specularFactor", name, 1.0)
    reflection_color = factors.color(specular, "specularColorFactor", name, 1.0, LARGEST)
    clearcoat, clearcoat_name = factors.extension("KHR_materials_clearcoat")
    transmission, transmission_name = factors.extension("KHR_materials_transmission")
    roughness = factors.number(pbr, "roughnessFactor", pbr_name, 1.0)
    metalness = factors.number(pbr, "metallicFactor", pbr_name, 1.0)
    if "KHR_materials_pbrSpecularGlossiness" in file.object(entry, "extensions", where):
        name = f"{where}.KHR_materials_pbrSpecularGlossiness"
        glossy = file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where) or {}
        roughness, metalness = 1.0, 0.0
        if "specularGlossinessTexture" in glossy:
            notes.ignored("specular-glossiness textures")
        else:
            roughness = 1.0 - factors.number(glossy, "glossinessFactor", name, 1.0)
            at_normal = factors.color(glossy, "specularFactor", name, 1.0, 1.0)
            red_share, green_share, blue_share = (value / NORMAL_REFLECTANCE for value in at_normal)
            reflection_color = (red_share, green_share, blue_share)
    notes.note(
        "what is seen through transmissive materials is not drawn: materials",
        int(transmission.get("transmissionFactor", 0) != 0),
    )
    return SurfaceFactors(
        roughness=roughness,
        metalness=metalness,
        normal_scale=factors.number(normal, "scale", f"{where}.normalTexture", 1.0, -LARGEST, LARGEST),
        occlusion_strength=factors.number(occlusion, "strength", f"{where}.occlusionTexture", 1.0),
        emissive=(red * glow, green * glow, blue * glow),
        ior=index if index == 0.0 else max(1.0, index),
        specular=reflection,
        specular_color=reflection_color,
        clearcoat=factors.number(clearcoat, "clearcoatFactor", clearcoat_name, 0.0),
        clearcoat_roughness=factors.number(clearcoat, "clearcoatRoughnessFactor", clearcoat_name, 0.0),
        transmission=factors.number(transmission, "transmissionFactor", transmission_name, 0.0),
    )
