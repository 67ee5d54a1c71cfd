"""Materials, samplers, images and the identity of textures."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.codec.color import srgb_to_linear
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.scene.load import load_scene
from viewer.scene.model import Sampler, Scene
from viewer.scene.report import report_json, report_lines


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


def test_an_image_that_differs_only_in_alpha_is_a_texture() -> None:
    pixels = noise(channels=4)
    pixels[..., :3] = 200
    builder = GltfBuilder()
    assert len(with_material(builder, builder.material(builder.image(png(pixels)), alphaMode="MASK")).textures) == 1
    builder = GltfBuilder()
    assert len(with_material(builder, builder.material(builder.image(png(pixels)))).textures) == 0


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
    with pytest.raises(InputError, match="has 5 bytes of the"):
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


def test_report_of_a_scene() -> None:
    builder = GltfBuilder()
    builder.json["extensionsUsed"] = ["KHR_materials_sheen"]
    scene = with_material(builder, builder.material(builder.image(png(noise()), name="oak\n"), alphaMode="BLEND"))
    lines = "\n".join(report_lines(scene))
    for part in (
        "1 triangles",
        "alphaMode BLEND",
        "alpha-hashed, at rest as the mean of 16 samples",
        "extension KHR_materials_sheen",
        "6 x 4  oak",
    ):
        assert part in lines
    assert report_json(scene)["textures"][0]["pixel_hash"] == scene.textures[0].pixel_hash
