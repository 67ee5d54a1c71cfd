"""Materials, samplers, images, variants and factors, and the identity of textures."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.codec.mips import srgb_to_linear
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from tests.support.spoilt_files import PromptEffects
from viewer.commands import run
from viewer.commands.command import Context
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.scene.model import Sampler, Scene, SurfaceFactors
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings


def with_material(builder: GltfBuilder, *materials: int) -> Scene:
    return built(builder.drawn(*(builder.triangle(material) for material in materials)))


def test_pixels_are_kept_and_v_is_not_flipped() -> None:
    pixels = noise(3, 5)
    builder = GltfBuilder()
    scene = with_material(builder, builder.material(builder.image(png(pixels), name="brick")))
    (texture,) = scene.textures
    np.testing.assert_array_equal(texture.pixels, pixels)
    assert (texture.name, texture.alpha, texture.origin) == ("brick", None, "image 0 'brick' (embedded)")
    assert texture.pixel_hash == hash_pixels(pixels)
    assert scene.materials[0].texture_id == 0


def test_equal_images_are_one_texture() -> None:
    pixels = noise()
    builder = GltfBuilder()
    first, second = builder.image(png(pixels), name="a"), builder.image(png(pixels), name="b")
    other = builder.image(png(noise(seed=1)), name="a")
    scene = with_material(builder, *(builder.material(image) for image in (first, second, other, first)))
    assert [material.texture_id for material in scene.materials] == [0, 0, 1, 0]
    assert [texture.name for texture in scene.textures] == ["a", "a_2"]
    assert "images with the pixels of another share its texture" in scene.report.notes


def test_constant_images_become_linear_factors() -> None:
    builder = GltfBuilder()
    image = builder.image(png(np.full((4, 4, 4), (188, 255, 0, 128), np.uint8)))
    factor = {"baseColorFactor": [0.5, 0.5, 1.0, 0.5]}
    scene = with_material(builder, builder.material(image, pbr=factor, alphaMode="BLEND"))
    assert scene.textures == ()
    linear = float(srgb_to_linear(np.array(188 / 255)))
    assert scene.materials[0].factor == pytest.approx((0.5 * linear, 0.5, 0.0, 0.5 * 128 / 255))
    assert scene.materials[0].texture_id == -1
    assert "constant images became factors" in scene.report.notes


def test_alpha_is_kept_where_it_is_read() -> None:
    pixels = noise(channels=4)
    builder = GltfBuilder()
    image = builder.image(png(pixels))
    opaque = with_material(builder, builder.material(image))
    assert opaque.textures[0].alpha is None
    assert opaque.textures[0].pixel_hash == hash_pixels(np.ascontiguousarray(pixels[..., :3]))
    np.testing.assert_array_equal(opaque.textures[0].pixels, pixels[..., :3])

    builder = GltfBuilder()
    image = builder.image(png(pixels))
    cut = builder.material(image, alphaMode="MASK", alphaCutoff=0.25)
    scene = with_material(builder, builder.material(image), cut)
    (texture,) = scene.textures
    np.testing.assert_array_equal(texture.alpha, pixels[..., 3])
    assert texture.pixel_hash == hash_pixels(pixels)
    assert (scene.materials[0].alpha_mode, scene.materials[0].alpha_cutoff) == ("mask", 0.25)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({}, Sampler()),
        (
            {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9728},
            Sampler(("clamp", "mirror"), False, False, "none"),
        ),
        ({"minFilter": 9729}, Sampler(minify_linear=True, mipmap="none")),
        ({"minFilter": 9984}, Sampler(minify_linear=False, mipmap="nearest")),
        ({"minFilter": 9985}, Sampler(minify_linear=True, mipmap="nearest")),
        ({"minFilter": 9986}, Sampler(minify_linear=False, mipmap="linear")),
        ({"wrapS": 1, "magFilter": "x"}, Sampler()),
    ],
)
def test_samplers(entry: dict[str, Any], expected: Sampler) -> None:
    builder = GltfBuilder()
    material = builder.material(builder.image(png(noise())))
    builder.json["textures"][0]["sampler"] = builder.add("samplers", **entry)
    assert with_material(builder, material).materials[0].sampler == expected


def test_specular_glossiness_unlit_and_double_sided() -> None:
    builder = GltfBuilder()
    image = builder.image(png(noise()))
    texture = builder.add("textures", source=image)
    glossiness = {"diffuseTexture": {"index": texture}, "diffuseFactor": [1.0, 0.5, 0.25, 1.0]}
    extensions = {"KHR_materials_pbrSpecularGlossiness": glossiness, "KHR_materials_unlit": {}}
    builder.json["extensionsRequired"] = sorted(extensions)
    scene = with_material(builder, builder.material(extensions=extensions, doubleSided=True))
    material = scene.materials[0]
    assert (material.texture_id, material.factor) == (0, (1.0, 0.5, 0.25, 1.0))
    assert material.unlit
    assert material.double_sided


def test_categories_come_from_extras() -> None:
    builder = GltfBuilder()
    by_image = builder.image(png(noise(seed=1)), extras={"category": "wood"})
    plain = builder.image(png(noise(seed=2)))
    neither = builder.image(png(noise(seed=3)))
    materials = [
        builder.material(by_image, extras={"category": "metal"}),
        builder.material(plain, extras={"category": "metal"}),
        builder.material(neither, extras=["category"]),
    ]
    assert [texture.category for texture in with_material(builder, *materials).textures] == ["wood", "metal", None]


def test_missing_and_broken_images_are_reported_and_the_factor_stays(tmp_path: Path) -> None:
    builder = GltfBuilder()
    whole = png(noise(64, 64))
    (tmp_path / "empty.png").write_bytes(b"")
    images = [
        builder.add("images", uri="nowhere.png"),
        builder.add("images", uri="empty.png"),
        builder.image(whole[: len(whole) // 2]),
        builder.image(b"no image at all"),
        builder.add("images", uri="data:image/png;base64,@@@"),
        builder.add("images", uri="../secret.png"),
        builder.add("images", uri="https://example.org/a.png"),
        builder.add("images", uri="/etc/hostname"),
        builder.add("images"),
    ]
    materials = [builder.material(image, pbr={"baseColorFactor": [0.1, 0.2, 0.3, 1.0]}) for image in images]
    builder.drawn(*(builder.triangle(material) for material in materials))
    scene = load_scene(builder.write(tmp_path / "scene.gltf"))
    assert scene.textures == ()
    assert all(material.factor == (0.1, 0.2, 0.3, 1.0) for material in scene.materials)
    assert all(material.missing_base for material in scene.materials)
    for index in images:
        assert any(f"images[{index}]" in line and "factor is used" in line for line in scene.report.missing), index


def test_external_files_and_data_uris(tmp_path: Path) -> None:
    (tmp_path / "my textures").mkdir()
    (tmp_path / "my textures" / "a b.png").write_bytes(png(noise(seed=1)))
    builder = GltfBuilder()
    outside = builder.add("images", uri="my%20textures/a%20b.png")
    inside = builder.add("images", uri="data:image/png;base64," + base64.b64encode(png(noise(seed=2))).decode())
    builder.drawn(builder.triangle(builder.material(outside)), builder.triangle(builder.material(inside)))
    for uri in (None, "data.bin"):
        scene = load_scene(builder.write(tmp_path / "scene.gltf", uri=uri))
        assert [texture.name for texture in scene.textures] == ["a b", "image 1"]
        assert scene.textures[0].origin == "my textures/a b.png"
        np.testing.assert_array_equal(scene.textures[1].pixels, noise(seed=2))
    (tmp_path / "data.bin").write_bytes(b"short")
    with pytest.raises(InputError, match="has 5 of"):
        load_scene(tmp_path / "scene.gltf")
    (tmp_path / "data.bin").unlink()
    with pytest.raises(InputError, match=r"data\.bin: cannot be read"):
        load_scene(tmp_path / "scene.gltf")


def test_files_that_nothing_reads_are_reported_when_absent(tmp_path: Path) -> None:
    builder = GltfBuilder()
    for name in ("bump.png", "unused.png"):
        builder.material(normalTexture={"index": builder.add("textures", source=builder.add("images", uri=name))})
    scene = load_scene(builder.drawn(builder.triangle(0)).write(tmp_path / "scene.gltf"))
    assert any("bump.png: cannot be read" in line for line in scene.report.missing)
    assert any("unused.png is not there" in line for line in scene.report.missing)


def test_webp_extension_is_preferred_to_its_fallback() -> None:
    builder = GltfBuilder()
    fallback, better = builder.image(png(noise(seed=1))), builder.image(png(noise(seed=2)))
    material = builder.material(fallback)
    builder.json["textures"][0]["extensions"] = {"EXT_texture_webp": {"source": better}}
    np.testing.assert_array_equal(with_material(builder, material).textures[0].pixels, noise(seed=2))


def test_a_required_extension_that_is_unknown_refuses_the_file() -> None:
    builder = GltfBuilder()
    builder.json["extensionsRequired"] = ["VENDOR_unheard_of", "KHR_materials_ior"]
    with pytest.raises(InputError, match="VENDOR_unheard_of is not supported"):
        with_material(builder, builder.material())


def test_materials_are_not_read_without_need_and_the_default_one_is_added() -> None:
    builder = GltfBuilder()
    unused = builder.material(builder.image(png(noise(seed=1))))
    scene = built(builder.drawn(builder.triangle()))
    assert scene.textures == ()
    assert [material.name for material in scene.materials] == [f"material {unused}", "default"]
    assert scene.primitives[0].material == 1


def shoe(**mapping: Any) -> GltfBuilder:
    """A triangle of material 0, of material 1 under "red" and "crimson", of material 2 under "blue"."""
    builder = GltfBuilder()
    for seed in range(3):
        builder.material(builder.image(png(noise(seed=seed))))
    names = [{"name": name} for name in ("red", "blue", "crimson")]
    builder.json["extensions"] = {"KHR_materials_variants": {"variants": names}}
    builder.json["extensionsRequired"] = ["KHR_materials_variants"]
    mappings = [{"material": 1, "variants": [0, 2]}, {"material": 2, "variants": [1], **mapping}]
    primitive = builder.triangle(0)
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": mappings}}
    return builder.drawn(primitive, builder.triangle(1))


def drawn_pixels(scene: Scene) -> np.ndarray:
    return scene.textures[scene.materials[scene.primitives[0].material].texture_id].pixels


@pytest.mark.parametrize(("variant", "seed"), [("", 0), ("red", 1), ("blue", 2), ("crimson", 1)])
def test_a_variant_is_drawn_and_textures_stay_those_of_all(tmp_path: Path, variant: str, seed: int) -> None:
    scene = load_scene(shoe().write(tmp_path / "shoe.glb"), variant)
    np.testing.assert_array_equal(drawn_pixels(scene), noise(seed=seed))
    assert scene.variants == ("red", "blue", "crimson")
    assert [t.pixel_hash for t in scene.textures] == [t.pixel_hash for t in built(shoe()).textures]
    assert scene.primitives[1].material == 1


def test_an_unknown_variant_is_refused_with_the_names_that_there_are(tmp_path: Path) -> None:
    path = shoe().write(tmp_path / "shoe.glb")
    with pytest.raises(InputError, match="no variant 'green'; there are red, blue, crimson"):
        load_scene(path, "green")
    plain = GltfBuilder()
    with pytest.raises(InputError, match="the scene has no variants"):
        load_scene(plain.drawn(plain.triangle()).write(tmp_path / "plain.glb"), "red")


@pytest.mark.parametrize(
    ("mapping", "words"),
    [({"material": 3}, "material: 3 is not an index below 3"), ({"variants": [3]}, "variants: 3 is not an index")],
)
def test_broken_mappings_name_the_field(mapping: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        built(shoe(**mapping))


def test_another_variant_or_moment_reads_no_image_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    builder = shoe()
    times, places = np.array([0, 2], np.float32), np.array([[0, 0, 0], [4, 0, 0]], np.float32)
    sampler = {"input": builder.accessor(times), "output": builder.accessor(places)}
    builder.add(
        "animations", samplers=[sampler], channels=[{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    )
    scene = load_scene(builder.write(tmp_path / "shoe.glb"))
    context = Context(new_session(scene, {}, ViewerSettings(), InitialView(), tmp_path))
    PromptEffects(context)
    decoded: list[str] = []

    def counted(data: bytes, name: str) -> Any:
        decoded.append(name)
        return decode_image(data, name)

    monkeypatch.setattr("viewer.scene.gltf.maps.images.decode_image", counted)
    run(context, "materials.variant", "blue")
    np.testing.assert_array_equal(drawn_pixels(context.session.scene), noise(seed=2))
    run(context, "animation.time", 1.0)
    session = context.session
    assert session.scene.motion is not None
    stand = session.scene.motion.at(session.view.pose)
    np.testing.assert_array_equal(stand.instances.transform[0, :3, 3], [2, 0, 0])
    assert (session.scene.variant, session.scene.report) == ("blue", scene.report)
    assert decoded == []


def test_a_file_that_has_changed_is_read_whole(tmp_path: Path) -> None:
    path = shoe().write(tmp_path / "shoe.glb")
    before = load_scene(path)
    changed = GltfBuilder()
    changed.material(changed.image(png(noise(8, 8, seed=9))))
    changed.drawn(changed.triangle(0)).write(path)
    scene = load_scene(path, before=before)
    assert [len(scene.materials), len(scene.textures)] == [1, 1]
    np.testing.assert_array_equal(drawn_pixels(scene), noise(8, 8, seed=9))


def scene_of(pbr: dict[str, Any] | None = None, **entry: Any) -> Scene:
    builder = GltfBuilder()
    return built(builder.drawn(builder.triangle(builder.material(pbr=pbr or {}, **entry))))


def factors_of(pbr: dict[str, Any] | None = None, **entry: Any) -> SurfaceFactors:
    return scene_of(pbr, **entry).materials[0].factors


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
        ([{"type": "area"}], 0, "must be one of directional"),
        (LIGHTS, 3, "not an index below 3"),
        (["sun"], 0, r"lights\[0\]: Expected object, got text"),
    ):
        with pytest.raises(InputError, match=message):
            lit(lights, {"light": number})
