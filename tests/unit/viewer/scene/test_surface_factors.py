"""Factors of materials: what extensions say of a surface, within what the specification allows."""

from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.scene.model import Scene, SurfaceFactors


def scene_of(pbr: dict[str, Any] | None = None, **entry: Any) -> Scene:
    builder = GltfBuilder()
    return built(builder.drawn(builder.triangle(builder.material(pbr=pbr or {}, **entry))))


def factors_of(pbr: dict[str, Any] | None = None, **entry: Any) -> SurfaceFactors:
    return scene_of(pbr, **entry).materials[0].factors


def test_defaults_are_those_of_the_specification() -> None:
    assert factors_of() == SurfaceFactors()


def test_extensions_are_read() -> None:
    extensions = {
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1.0, 2.0, 0.5]},
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.125},
        "KHR_materials_transmission": {"transmissionFactor": 0.25, "transmissionTexture": {"index": 0}},
    }
    scene = scene_of(
        {"roughnessFactor": 0.25, "metallicFactor": 0.5}, emissiveFactor=[1, 0, 0.5], extensions=extensions
    )
    assert scene.materials[0].factors == SurfaceFactors(
        roughness=0.25,
        metalness=0.5,
        emissive=(1.0, 0.0, 0.5),
        ior=1.33,
        specular=0.5,
        specular_color=(1.0, 2.0, 0.5),
        clearcoat=0.75,
        clearcoat_roughness=0.125,
        transmission=0.25,
    )
    assert {f"{name}: materials" for name in extensions} <= set(scene.report.honoured)
    assert "KHR_materials_transmission: transmissionTexture" in scene.report.ignored
    assert any("seen through transmissive" in line for line in scene.report.notes)


def test_numbers_out_of_range_are_brought_into_it() -> None:
    scene = scene_of(
        {"roughnessFactor": -1.0, "metallicFactor": 7.0},
        emissiveFactor=[-1, 2, 0.5],
        extensions={"KHR_materials_ior": {"ior": 0.5}, "KHR_materials_emissive_strength": {"emissiveStrength": -2.0}},
    )
    factors = scene.materials[0].factors
    assert (factors.roughness, factors.metalness, factors.emissive, factors.ior) == (0.0, 1.0, (0.0, 0.0, 0.0), 1.0)
    assert any("out of range" in line for line in scene.report.notes)
    assert factors_of(extensions={"KHR_materials_ior": {"ior": 0.0}}).ior == 0.0


def test_specular_glossiness() -> None:
    glossy: dict[str, Any] = {"glossinessFactor": 0.75, "specularFactor": [0.04, 0.08, 0.02]}
    factors = factors_of({"metallicFactor": 1.0}, extensions={"KHR_materials_pbrSpecularGlossiness": glossy})
    assert (factors.roughness, factors.metalness) == (0.25, 0.0)
    assert factors.specular_color == pytest.approx((1.0, 2.0, 0.5))
    builder = GltfBuilder()
    glossy["specularGlossinessTexture"] = {"index": builder.add("textures", source=builder.image(png(noise())))}
    material = builder.material(extensions={"KHR_materials_pbrSpecularGlossiness": glossy})
    scene = built(builder.drawn(builder.triangle(material)))
    assert scene.materials[0].factors == SurfaceFactors(roughness=1.0, metalness=0.0)
    assert "specular-glossiness textures" in scene.report.ignored


LIGHTS = [
    {"type": "directional", "color": [1.0, 0.5, 0.0], "intensity": 3.0},
    {"type": "point", "intensity": 100.0, "range": 5.0},
    {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.6}},
]


def lit(lights: list[Any], *nodes: dict[str, Any]) -> Scene:
    builder = GltfBuilder()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    for node in nodes:
        number = node.pop("light")
        builder.add("nodes", extensions={"KHR_lights_punctual": {"light": number}}, **node)
    return built(builder.drawn(builder.triangle()))


def test_lights_stand_in_world_space() -> None:
    half = float(np.sqrt(0.5))
    # A quarter turn about X takes -Z to +Y.
    turned = [half, 0.0, 0.0, half]
    scene = lit(
        LIGHTS,
        {"light": 0, "rotation": turned},
        {"light": 1, "translation": [1.0, 2.0, 3.0], "scale": [9.0, 9.0, 9.0]},
        {"light": 2, "translation": [0.0, 1.0, 0.0], "rotation": turned},
        {"light": 0},
    )
    sun, lamp, spot, second = scene.lights
    assert (sun.kind, lamp.kind, spot.kind, second.kind) == ("directional", "point", "spot", "directional")
    assert sun.color == (3.0, 1.5, 0.0)
    assert sun.direction == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert second.direction == pytest.approx((0.0, 0.0, -1.0))
    assert (lamp.position, lamp.reach, lamp.color) == ((1.0, 2.0, 3.0), 5.0, (100.0, 100.0, 100.0))
    assert (spot.inner_cone, spot.outer_cone, spot.position) == (0.2, 0.6, (0.0, 1.0, 0.0))
    assert scene.report.used["lights"] == 4
    assert "KHR_lights_punctual: directional lights (2)" in scene.report.honoured


def test_lights_that_are_wrong_are_refused_or_brought_into_range() -> None:
    (spot,) = lit(
        [{"type": "spot", "intensity": -1.0, "spot": {"innerConeAngle": 2, "outerConeAngle": 9}}], {"light": 0}
    ).lights
    assert spot.color == (0.0, 0.0, 0.0)
    assert spot.inner_cone == spot.outer_cone == pytest.approx(np.pi / 2)
    flat = lit(LIGHTS, {"light": 0, "scale": [1.0, 1.0, 0.0]})
    assert flat.lights == ()
    assert any("no direction to shine in" in line for line in flat.report.ignored)
    for lights, number, message in (
        ([{"type": "area"}], 0, "none of directional"),
        (LIGHTS, 3, "not an index below 3"),
        (["sun"], 0, "must be an object"),
    ):
        with pytest.raises(InputError, match=message):
            lit(lights, {"light": number})
