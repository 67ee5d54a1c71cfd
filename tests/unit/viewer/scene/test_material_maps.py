"""Maps of materials: what is read of which channel, what becomes a factor, and what block formats keep of them."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.maps import MAP_CHANNELS, MAPS, PLANES, MapName, map_slices
from ntc.codec.mips import srgb_to_linear
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import compress_texture
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.picture_scenes import as_set, scene_of, texture_of
from tests.support.scenes import built
from viewer.scene.gltf.maps.images import resampled
from viewer.scene.map_pictures import (
    compressed_plane_mips,
    compressed_scene,
    compression_requests,
    map_pictures,
    plane_mips,
)
from viewer.scene.model import Material, Sampler, Scene, SceneTexture, SurfaceFactors
from viewer.scene.report import report_json, report_lines
from viewer.scene.source_textures import source_textures, without_alpha


def normals(height: int = 4, width: int = 6, seed: int = 0) -> NDArray[np.uint8]:
    """[height, width, 3] unit normals as an image."""
    random = np.random.default_rng(seed)
    vectors = random.normal(size=(height, width, 3)) * (1, 1, 0.3) + (0, 0, 1.5)
    vectors /= np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.rint(vectors * 127.5 + 127.5).astype(np.uint8)


class Maps:
    """A builder whose `scene` has one material for each dict of textures given."""

    def __init__(self) -> None:
        self.builder = GltfBuilder()
        self.primitives: list[dict[str, Any]] = []

    def info(self, pixels: NDArray[np.uint8] | bytes, sampler: int | None = None, **info: Any) -> dict[str, Any]:
        """A textureInfo of a new image."""
        image = self.builder.image(pixels if isinstance(pixels, bytes) else png(pixels))
        return self.of_image(image, sampler, **info)

    def of_image(self, image: int, sampler: int | None = None, **info: Any) -> dict[str, Any]:
        """A textureInfo of the image `image`."""
        entry = {"source": image} | ({} if sampler is None else {"sampler": sampler})
        return {"index": self.builder.add("textures", **entry), **info}

    def material(self, attributes: dict[str, NDArray[Any]] | None = None, **entry: Any) -> None:
        """A triangle with a material of `entry`; keys of pbrMetallicRoughness are moved there."""
        inside = ("baseColorTexture", "metallicRoughnessTexture", "metallicFactor", "roughnessFactor")
        pbr = {key: entry.pop(key) for key in inside if key in entry}
        number = self.builder.material(pbr=pbr, **entry)
        self.primitives.append(self.builder.triangle(number, **(attributes or {})))

    @property
    def scene(self) -> Scene:
        return built(self.builder.drawn(*self.primitives))


def one(maps: Maps) -> tuple[Material, tuple[SceneTexture, ...], Scene]:
    scene = maps.scene
    return scene.materials[0], scene.textures, scene


def test_all_maps_of_a_material_are_one_set_in_the_order_of_maps() -> None:
    maps = Maps()
    base, bump, packed, glow = noise(seed=1), normals(seed=2), noise(seed=3), noise(seed=4)
    orm = maps.builder.image(png(packed))
    maps.material(
        baseColorTexture=maps.info(base),
        metallicRoughnessTexture=maps.of_image(orm),
        roughnessFactor=0.5,
        metallicFactor=0.25,
        normalTexture=maps.info(bump, scale=0.75),
        occlusionTexture=maps.of_image(orm, strength=0.5),
        emissiveTexture=maps.info(glow),
        emissiveFactor=[1.0, 0.5, 0.25],
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
    )
    material, (texture,), scene = one(maps)
    assert texture.maps == ("base", "normal", "roughness", "metalness", "emissive", "occlusion")
    np.testing.assert_array_equal(texture.pixels, base)
    np.testing.assert_array_equal(texture.further_maps["normal"], bump[..., :2])
    np.testing.assert_array_equal(texture.further_maps["roughness"], packed[..., 1:2])
    np.testing.assert_array_equal(texture.further_maps["metalness"], packed[..., 2:3])
    np.testing.assert_array_equal(texture.further_maps["emissive"], glow)
    np.testing.assert_array_equal(texture.further_maps["occlusion"], packed[..., 0:1])
    assert texture.pixel_hash == hash_pixels(base)
    (source,) = source_textures(scene, None, "all")
    assert (source.maps, source.pixel_hash) == (texture.maps, texture.set_hash)
    assert texture.set_hash == hash_pixels(source.pixels)
    places = map_slices(source.maps, 11)
    np.testing.assert_array_equal(source.pixels[..., places["emissive"]], glow)
    assert material.surface is not None
    assert material.emission is not None
    assert (material.texture_id, material.surface.texture_id, material.emission.texture_id) == (0, 0, 0)
    assert material.surface.maps == ("normal", "roughness", "metalness")
    assert material.emission.maps == ("emissive", "occlusion")
    assert material.factors == SurfaceFactors(0.5, 0.25, 0.75, 0.5, (4.0, 2.0, 1.0))
    # Roughness, metalness and occlusion come from one image.
    assert (scene.report.used["images"], scene.report.used["textures"]) == (4, 1)
    (plain,) = source_textures(scene, None)
    assert (plain.maps, plain.pixel_hash) == (("base",), texture.pixel_hash)


def test_constant_channels_become_factors_and_cost_nothing() -> None:
    maps = Maps()
    packed = noise()
    packed[..., 1], packed[..., 2] = 51, 0
    glow = np.full((4, 6, 3), (255, 0, 188), np.uint8)
    maps.material(
        baseColorTexture=maps.info(noise(seed=1)),
        metallicRoughnessTexture=maps.info(packed),
        roughnessFactor=0.5,
        normalTexture=maps.info(np.full((4, 6, 3), (128, 128, 255), np.uint8)),
        emissiveTexture=maps.info(glow),
        emissiveFactor=[0.5, 1.0, 1.0],
    )
    material, (texture,), scene = one(maps)
    assert (texture.maps, material.surface, material.emission) == (("base",), None, None)
    assert material.factors.roughness == pytest.approx(0.1)
    assert material.factors.metalness == 0.0
    assert material.factors.emissive == pytest.approx((0.5, 0.0, float(srgb_to_linear(np.array(188 / 255)))))
    assert "constant roughness maps became factors: materials" in scene.report.notes
    assert "constant normal maps have no effect: materials" in scene.report.notes


def test_maps_without_effect_are_not_read() -> None:
    maps = Maps()
    maps.material(
        metallicRoughnessTexture=maps.info(noise()),
        roughnessFactor=0.0,
        metallicFactor=0.0,
        normalTexture=maps.info(b"no image", scale=0.0),
        emissiveTexture=maps.info(b"no image"),
        occlusionTexture=maps.info(b"no image", strength=0.0),
    )
    maps.material(
        extensions={"KHR_materials_unlit": {}}, normalTexture=maps.info(b"no image"), emissiveFactor=[1, 1, 1]
    )
    scene = maps.scene
    assert scene.textures == ()
    assert scene.report.missing == ()
    assert scene.report.used["images"] == 0
    assert scene.materials[1].factors == SurfaceFactors()


def test_images_that_materials_share_are_in_one_texture() -> None:
    maps = Maps()
    base, bump, packed, other = (png(noise(seed=1)), png(normals(seed=2)), png(noise(seed=3)), png(normals(seed=5)))
    maps.material(baseColorTexture=maps.info(base))
    maps.material(
        baseColorTexture=maps.info(base), normalTexture=maps.info(bump), metallicRoughnessTexture=maps.info(packed)
    )
    maps.material(baseColorTexture=maps.info(noise(seed=4)), normalTexture=maps.info(bump))
    maps.material(baseColorTexture=maps.info(base), normalTexture=maps.info(other))
    scene = maps.scene
    assert [texture.maps for texture in scene.textures] == [
        ("base", "normal", "roughness", "metalness"),
        ("base",),
        ("normal",),
    ]
    surfaces = [material.surface for material in scene.materials]
    assert [None if surface is None else surface.texture_id for surface in surfaces] == [None, 0, 0, 2]
    assert surfaces[2] is not None
    assert surfaces[2].maps == ("normal",)
    assert [material.texture_id for material in scene.materials] == [0, 0, 1, 0]
    # Callers that want base colours alone see the ids that base colours have.
    assert [texture.name for texture in source_textures(scene, None)] == [t.name for t in scene.textures[:2]]
    assert [texture.maps for texture in source_textures(scene, None, "all")] == [t.maps for t in scene.textures]


def test_a_set_without_base_colour_has_a_picture() -> None:
    maps = Maps()
    bump = normals(seed=2)
    maps.material(normalTexture=maps.info(bump))
    material, (texture,), scene = one(maps)
    assert np.abs(texture.pixels.astype(int) - bump).max() <= 2
    assert (texture.pixel_hash, material.texture_id, material.primary_texture) == (texture.set_hash, -1, 0)
    assert source_textures(scene, None) == ()
    (source,) = source_textures(scene, 3, "all")
    assert source.pixels.shape == (2, 3, 2)
    vectors = source.pixels / 127.5 - 1
    assert (np.square(vectors).sum(axis=2) < 1.02).all()


def test_planes_of_another_size_or_sampler_are_sets_of_their_own() -> None:
    maps = Maps()
    clamped = maps.builder.add("samplers", wrapS=33071, wrapT=33071)
    maps.material(
        baseColorTexture=maps.info(noise(8, 12)),
        normalTexture=maps.info(normals(), sampler=clamped),
        emissiveTexture=maps.info(noise(seed=7), sampler=clamped),
        emissiveFactor=[1, 1, 1],
    )
    material, textures, scene = one(maps)
    assert [texture.maps for texture in textures] == [("base",), ("normal", "emissive")]
    assert material.surface is not None
    assert material.surface.sampler == Sampler(("clamp", "clamp"))
    assert [source.wrap[0] for source in source_textures(scene, None, "all")] == ["repeat", "clamp"]


def test_maps_of_a_plane_are_brought_to_the_larger_size() -> None:
    maps = Maps()
    bump, packed = normals(8, 4), noise(4, 6)
    maps.material(normalTexture=maps.info(bump), metallicRoughnessTexture=maps.info(packed))
    material, (texture,), scene = one(maps)
    assert texture.maps == ("normal", "roughness", "metalness")
    np.testing.assert_array_equal(texture.further_maps["roughness"], resampled(packed[..., 1:2], 4, 8))
    assert any("roughness maps resampled" in line for line in scene.report.notes)
    assert material.surface is not None


def test_maps_of_a_plane_that_are_sampled_otherwise_are_left_out() -> None:
    maps = Maps()
    moved = {"KHR_texture_transform": {"offset": [0.5, 0.0]}}
    maps.material(
        normalTexture=maps.info(normals()), metallicRoughnessTexture=maps.info(noise(seed=3), extensions=moved)
    )
    material, (texture,), scene = one(maps)
    assert texture.maps == ("normal",)
    ignored = [line for line in scene.report.ignored if "whose UVs or sampler" in line]
    assert [line.split()[0] for line in ignored] == ["roughness", "metalness"]
    assert material.factors.roughness == 1.0


def test_transforms_are_relative_to_the_uvs_of_the_base_colour() -> None:
    maps = Maps()
    base = {"KHR_texture_transform": {"scale": [2.0, 4.0], "offset": [0.5, 0.0], "rotation": 0.3}}
    surface = {"KHR_texture_transform": {"scale": [3.0, 0.5], "offset": [0.1, 0.2], "rotation": -0.8}}
    packed = maps.builder.image(png(noise(seed=3)))
    maps.material(
        baseColorTexture=maps.info(noise(), extensions=base),
        metallicRoughnessTexture=maps.of_image(packed, extensions=surface),
        occlusionTexture=maps.of_image(packed),
    )
    material, textures, scene = one(maps)
    assert [texture.maps for texture in textures] == [("base",), ("roughness", "metalness"), ("occlusion",)]
    raw = np.array([[0, 0], [1, 0], [0, 1]])
    cosine, sine = np.cos(-0.8), np.sin(-0.8)
    turned = raw * (3.0, 0.5) @ np.array([[cosine, sine], [-sine, cosine]]).T + (0.1, 0.2)
    assert material.surface is not None
    assert material.emission is not None
    assert not material.surface.second_uvs
    for plane, expected in ((material.surface, turned), (material.emission, raw)):
        rows = np.array(plane.uv_transform).reshape(2, 3)
        np.testing.assert_allclose(scene.geometry.uvs @ rows[:, :2].T + rows[:, 2], expected, atol=1e-6)


def test_a_second_set_of_uvs_is_kept_and_a_third_is_left_out() -> None:
    second = np.array([[0.5, 0], [1, 0.25], [0, 1]], np.float32)
    maps = Maps()
    shrunk = {"KHR_texture_transform": {"scale": [0.5, 0.5]}}
    maps.material(
        {"TEXCOORD_1": second, "TEXCOORD_2": second},
        baseColorTexture=maps.info(noise()),
        normalTexture=maps.info(normals(), texCoord=1, extensions=shrunk),
        occlusionTexture=maps.info(noise(seed=1), texCoord=2),
    )
    maps.material(baseColorTexture=maps.info(noise()))
    material, textures, scene = one(maps)
    assert [texture.maps for texture in textures] == [("base",), ("normal",)]
    assert material.surface is not None
    assert material.surface.second_uvs
    assert material.surface.uv_transform == (0.5, 0.0, 0.0, 0.0, 0.5, 0.0)
    assert scene.geometry.second_uvs is not None
    np.testing.assert_array_equal(scene.geometry.second_uvs, np.concatenate([second, np.zeros((3, 2))]))
    assert "occlusion maps by a third set of UVs: materials" in scene.report.ignored


@pytest.mark.parametrize("scale", [[0.0, 1.0], [1e-38, 1e30]])
def test_a_base_colour_whose_transform_has_no_inverse_leaves_the_others_their_uvs(scale: list[float]) -> None:
    maps = Maps()
    flat = {"KHR_texture_transform": {"scale": scale}}
    maps.material(baseColorTexture=maps.info(noise(), extensions=flat), normalTexture=maps.info(normals()))
    material, _, scene = one(maps)
    assert material.surface is not None
    assert (material.surface.second_uvs, material.surface.uv_transform[0]) == (True, 1.0)
    assert scene.geometry.second_uvs is not None
    np.testing.assert_array_equal(scene.geometry.second_uvs, [[0, 0], [1, 0], [0, 1]])


def test_normals_are_made_unit_before_z_is_dropped() -> None:
    maps = Maps()
    pixels = normals()
    half = np.rint((pixels / 127.5 - 1) * 0.5 * 127.5 + 127.5).astype(np.uint8)
    half[0, 0] = 0
    maps.material(normalTexture=maps.info(half))
    _, (texture,), scene = one(maps)
    xy = texture.further_maps["normal"].astype(int)
    assert np.abs(xy - pixels[..., :2]).reshape(-1, 2)[1:].max() <= 2
    assert xy[0, 0].tolist() == [128, 128]
    assert any("were normalised: 100 %" in line for line in scene.report.notes)


def test_two_channel_normals_are_kept_as_they_are() -> None:
    maps = Maps()
    pixels = normals()
    pixels[..., 2] = 0
    maps.material(normalTexture=maps.info(pixels))
    _, (texture,), _ = one(maps)
    np.testing.assert_array_equal(texture.further_maps["normal"], pixels[..., :2])


@pytest.mark.parametrize(
    ("image", "remark"),
    [
        (png(noise(channels=1)), "is grey"),
        (png(np.full((4, 6, 3), (200, 128, 220), np.uint8)), "is not upright"),
        (b"no image at all", "factors are used"),
        (b"", "factors are used"),
    ],
)
def test_normal_maps_that_cannot_be_used_are_named_and_the_rest_is_shown(image: bytes, remark: str) -> None:
    maps = Maps()
    maps.material(baseColorTexture=maps.info(noise()), normalTexture=maps.info(image))
    material, (texture,), scene = one(maps)
    assert (material.surface, texture.maps) == (None, ("base",))
    assert any(remark in line for line in (*scene.report.notes, *scene.report.missing))


def test_a_missing_base_colour_leaves_the_other_maps() -> None:
    maps = Maps()
    maps.material(baseColorTexture=maps.info(b"broken"), normalTexture=maps.info(normals()))
    material, (texture,), _ = one(maps)
    assert (material.texture_id, texture.maps) == (-1, ("normal",))


def test_alpha_is_part_of_the_hash_of_a_set() -> None:
    hashes = []
    for seed in (1, 2):
        maps = Maps()
        pixels = noise(channels=4)
        pixels[..., 3] = noise(channels=1, seed=seed)[..., 0]
        maps.material(baseColorTexture=maps.info(pixels), normalTexture=maps.info(normals()), alphaMode="MASK")
        _, (texture,), scene = one(maps)
        assert texture.alpha is not None
        (source,) = source_textures(scene, None, "all")
        assert (source.maps, source.channels, source.cutoff) == (("base", "normal", "alpha"), 6, 0.5)
        np.testing.assert_array_equal(source.pixels[..., -1], texture.alpha)
        assert without_alpha(source).maps == ("base", "normal")
        hashes.append(texture.set_hash)
    assert hashes[0] != hashes[1]


def test_small_files_cannot_ask_for_much_memory_by_resampling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viewer.scene.gltf.maps.images.FREE_PIXEL_BYTES", 1 << 20)
    monkeypatch.setattr("viewer.scene.gltf.maps.images.LARGE_EXPANSION", 1)
    maps = Maps()
    large = normals(256, 256)
    large[:] = large[:1, :1]
    large[0, 0, 0] ^= 64
    bump = png(large)
    for seed in range(12):
        packed = noise(2, 2, seed=seed)
        maps.material(normalTexture=maps.info(bump), metallicRoughnessTexture=maps.info(packed))
    with pytest.raises(InputError, match="hold too many texels"):
        maps.scene  # noqa: B018


pytest.importorskip("quicktex", reason="block encoders are not installed (extra: lab)")
SIDE = 32


def smooth(channels: int, seed: int) -> np.ndarray:
    """[SIDE, SIDE, channels] uint8 that changes slowly, as maps do."""
    rows, columns = np.indices((SIDE, SIDE)) / SIDE
    parts = [
        128 + 90 * np.sin(3.0 * rows + seed + number) * np.cos(2.0 * columns + number) for number in range(channels)
    ]
    return np.stack(parts, axis=2).astype(np.uint8)


def material_set(maps: tuple[MapName, ...]) -> SceneTexture:
    """A set of smooth maps."""
    further: dict[MapName, np.ndarray] = {
        name: smooth(MAP_CHANNELS[name], place) for place, name in enumerate(maps) if name != "base"
    }
    return as_set(texture_of(smooth(3, 7)), maps, further)


@pytest.mark.parametrize("block_format", ["bc1", "bc7", "astc-6x6"])
@pytest.mark.parametrize(
    "maps", [MAPS, ("base", "normal"), ("normal", "roughness", "metalness"), ("base", "occlusion")]
)
def test_hardware_reads_every_map_back(block_format: BlockFormat, maps: tuple[MapName, ...]) -> None:
    texture = material_set(maps)
    scene = scene_of([], [], [texture, material_set(("base",))])
    requests = compression_requests(scene, block_format, None)
    found = compressed_scene(block_format, requests, [compress_texture(one) for own in requests for one in own])
    assert len(found.further[0]) == len(map_pictures(texture)) - 1
    assert found.further[1] == ()
    sizes = [picture.stored_bytes for picture in (*found.textures, *found.further[0])]
    assert found.stored_bytes == sum(sizes)
    for plane in PLANES:
        if not any(name in maps for name in {"base": ("base",), "surface": MAPS[1:4], "emission": MAPS[4:]}[plane]):
            continue
        original, read = plane_mips(texture, plane), compressed_plane_mips(found, 0, plane)
        assert [mip.shape for mip in read] == [mip.shape for mip in original]
        for mine, theirs in zip(read[:2], original[:2], strict=True):
            assert np.abs(mine.astype(int) - theirs).mean() < 9.0, plane


def test_reports_name_the_maps() -> None:
    maps = Maps()
    maps.material(baseColorTexture=maps.info(noise()), normalTexture=maps.info(normals()))
    _, (texture,), scene = one(maps)
    assert any("base + normal" in line for line in report_lines(scene))
    report = report_json(scene)
    assert report["textures"][0]["maps"] == ["base", "normal"]
    assert report["textures"][0]["set_hash"] == texture.set_hash
    assert report["materials"][0]["planes"]["surface"]["maps"] == ("normal",)
    assert "normal maps: materials" in report["honoured"]


def test_resampling_keeps_constants_ends_and_means() -> None:
    ramp = np.array([0, 50, 100, 150, 200], np.uint8)[None, :, None]
    np.testing.assert_array_equal(resampled(ramp, 10, 1)[0, :, 0], [0, 13, 38, 63, 88, 113, 138, 163, 188, 200])
    assert (resampled(np.full((3, 5, 2), 77, np.uint8), 7, 4) == 77).all()
