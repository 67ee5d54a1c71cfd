"""What the built-in scenes promise, and what the scripts that build them make."""

import json
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from assets.build.courtyard import cameras
from assets.build.gallery import SHOWN, sphere
from assets.build.glb import GlbWriter
from assets.build.gltf_materials import encode_images
from assets.build.materials import recipes
from assets.build.patterns import SIZE
from assets.build.shapes import Shape
from assets.build.surfaces import normal_image
from ntc.codec.config import GroupingConfig
from ntc.codec.maps import PLANES
from ntc.grouping import GroupingInputs, make_grouping
from ntc.pack.file import read_pack
from tests.support.scenes import world_triangles
from viewer.locations import builtin_scene_path, named_scene
from viewer.scene.cameras_file import read_cameras
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.source_textures import source_textures
from viewer.state.pack_files import match_scene, packs_beside

CATEGORIES = [
    "aerial",
    "brick",
    "concrete",
    "fabric",
    "floor",
    "metal",
    "plaster",
    "rock",
    "roofing",
    "terrain",
    "wood",
]
LARGEST_FOLDER = 26e6


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(builtin_scene_path())


def test_five_textures_in_each_category(scene: Scene) -> None:
    assert Counter(texture.category for texture in scene.textures) == dict.fromkeys(CATEGORIES, 5)
    assert {texture.pixels.shape for texture in scene.textures} == {(512, 512, 3)}
    assert min(float(texture.pixels.std()) for texture in scene.textures) > 5.0


def test_it_uses_what_the_renderer_has_to_show(scene: Scene) -> None:
    materials = scene.materials
    assert {material.alpha_mode for material in materials} == {"opaque", "mask"}
    assert any(material.double_sided for material in materials)
    assert {material.sampler.wrap for material in materials} == {("repeat", "repeat"), ("clamp", "clamp")}
    assert scene.geometry.colors is not None
    assert (np.linalg.det(scene.instances.transform[:, :3, :3]) < 0).any()
    assert max(Counter(scene.instances.primitive.tolist()).values()) > 1
    assert any("KHR_texture_transform" in line for line in scene.report.honoured)
    assert not scene.report.missing


def test_materials_are_whole(scene: Scene) -> None:
    for texture in scene.textures:
        expected = {"base", "normal", "roughness", "occlusion"}
        if texture.category == "metal" or texture.name == "roofing_corrugated":
            expected |= {"metalness"}
        if texture.name == "metal_sign":
            expected |= {"emissive"}
        assert set(texture.maps) == expected, texture.name
        assert all(pixels.std() > 0.5 for pixels in texture.further_maps.values()), texture.name
        xy = texture.further_maps["normal"] / 127.5 - 1
        # Bumps lean no way on the whole, but for tiles that overlap, and few stand steeper than 60 degrees.
        assert texture.category == "roofing" or np.abs(xy.mean(axis=(0, 1))).max() < 0.03, texture.name
        assert (np.square(xy).sum(axis=2) > 0.75).mean() < 0.15, texture.name
    used = [material for material in scene.materials if material.name != "glass"]
    assert all(material.surface is not None and material.emission is not None for material in used)
    for material in used:
        assert {material.plane_texture(plane) for plane in PLANES} == {material.texture_id}, material.name
    assert max(material.factors.emissive[0] for material in used) > 1.0


def test_normals_follow_the_triangles(scene: Scene) -> None:
    geometry = scene.geometry
    assert geometry.normals is not None
    for primitive in scene.primitives:
        rows = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count].astype(int)
        corners = geometry.positions[rows + primitive.base_vertex].reshape(-1, 3, 3).astype(np.float64)
        own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        normals = geometry.normals[rows + primitive.base_vertex].reshape(-1, 3, 3)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-5)
        assert np.einsum("tck,tk->tc", normals, own).min() > 0.75, primitive.name


def test_named_cameras_are_in_both_files(scene: Scene) -> None:
    path = builtin_scene_path().with_name("courtyard.cameras.json")
    assert set(json.loads(path.read_text())[0]) == {"name", "eye", "target", "fov"}
    listed = read_cameras(path)
    assert [camera.name for camera in scene.cameras] == [camera.name for camera in listed]
    assert len(listed) >= 6
    for own, other in zip(scene.cameras, listed, strict=True):
        np.testing.assert_allclose(own.eye, other.eye, atol=1e-5)
        assert own.fov_degrees == pytest.approx(other.fov_degrees)
        ways = [np.subtract(camera.target, camera.eye) for camera in (own, other)]
        ways = [way / np.linalg.norm(way) for way in ways]
        np.testing.assert_allclose(ways[0], ways[1], atol=1e-5)


@pytest.mark.parametrize("grouping", ["baseline", "clustered"])
def test_packs_hold_every_texture(scene: Scene, grouping: str) -> None:
    (path,) = [path for path in packs_beside(builtin_scene_path()) if path.name == f"courtyard.{grouping}.ntc"]
    pack = read_pack(path)
    assert match_scene(pack, scene).matched == 55
    assert [texture.maps for texture in pack.textures] == [texture.maps for texture in scene.textures]
    assert pack.grouping.name == grouping
    assert len(pack.decoders) == {"baseline": 55, "clustered": 10}[grouping]
    assert all(texture.psnr_db is not None and texture.psnr_db > 15.0 for texture in pack.textures)


def test_random_has_the_group_sizes_of_clustered(scene: Scene) -> None:
    textures = source_textures(scene, 32)
    sizes = [
        sorted(Counter(make_grouping(GroupingConfig(name, clusters=10), textures, GroupingInputs()).groups).values())
        for name in ("random", "clustered")
    ]
    assert sizes[0] == sizes[1]


def test_files_stay_small() -> None:
    folder: Path = builtin_scene_path().parent
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < LARGEST_FOLDER
    assert builtin_scene_path().stat().st_size < 26e6


CLAMPED = ("metal_sign", "wood_sign")
PLANE_STEP = 1e-3
"""Triangles closer than about this (in metres), facing the same way, would flicker."""


def overlaps(triangle: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of `others` [N, 3, 2] share more than a hair with `triangle` [3, 2]: no edge of either parts them."""
    apart = np.zeros(len(others), bool)
    for edges in (np.broadcast_to(triangle, others.shape), others):
        direction = np.roll(edges, -1, axis=1) - edges
        normal = np.stack([direction[..., 1], -direction[..., 0]], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        own = np.einsum("nek,vk->nev", normal, triangle)
        their = np.einsum("nek,nvk->nev", normal, others)
        gap = np.maximum(their.min(axis=2) - own.max(axis=2), own.min(axis=2) - their.max(axis=2))
        apart |= (gap > -1e-3).any(axis=1)
    return ~apart


@pytest.mark.slow
def test_triangles_are_neither_empty_nor_in_one_plane_with_others(scene: Scene) -> None:
    triangles = world_triangles(scene)
    assert 10_000 <= len(triangles) <= 60_000
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    assert doubled.min() > 1e-9
    normals /= doubled[:, None]
    distances = np.einsum("tk,tk->t", normals, triangles[:, 0])
    planes: dict[bytes, list[int]] = defaultdict(list)
    keys = np.concatenate([np.rint(normals * 200), np.rint(distances[:, None] / PLANE_STEP)], axis=1).astype(np.int64)
    for number, key in enumerate(keys):
        planes[key.tobytes()].append(number)
    clashes = []
    for members in planes.values():
        axes = np.delete(np.arange(3), int(np.abs(normals[members[0]]).argmax()))
        flat = triangles[members][..., axes]
        low, high = flat.min(axis=1), flat.max(axis=1)
        for i in range(len(members) - 1):
            near = np.flatnonzero(((low[i + 1 :] < high[i]) & (high[i + 1 :] > low[i])).all(axis=1)) + i + 1
            hits = near[overlaps(flat[i], flat[near])] if near.size else near
            clashes += [(triangles[members[i]].mean(axis=0), triangles[members[j]].mean(axis=0)) for j in hits]
    assert not clashes, [tuple(np.round(np.concatenate(pair), 2)) for pair in clashes[:10]]


@pytest.mark.slow
def test_textures_repeat_without_a_seam(scene: Scene) -> None:
    for texture in scene.textures:
        if texture.name in CLAMPED:
            continue
        pixels = texture.pixels.astype(np.float64)
        for axis in (0, 1):
            steps = np.abs(np.diff(pixels, axis=axis, append=pixels.take([0], axis=axis))).mean(axis=(1 - axis, 2))
            assert steps[-1] <= 1.5 * np.sort(steps)[-8], texture.name


def test_names_of_cameras_and_textures_are_those_of_the_scripts(scene: Scene) -> None:
    assert [camera.name for camera in scene.cameras] == [camera["name"] for camera in cameras()]
    assert all(camera.name.isalpha() and camera.name.islower() for camera in scene.cameras)
    assert scene.cameras[0].name == "entrance"
    assert {texture.name: texture.category for texture in scene.textures} == {r.name: r.category for r in recipes()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["wood_sign", *(pytest.param(name, marks=pytest.mark.nightly) for name in ("brick_red", "metal_lattice"))]
)
def test_textures_are_those_of_the_scripts(scene: Scene, name: str) -> None:
    number = [recipe.name for recipe in recipes()].index(name)
    made = {kind: decode_image(content, name)[..., :3] for kind, (_, content) in encode_images(number).items()}
    (shipped,) = (texture for texture in scene.textures if texture.name == name)
    pairs = [
        (made["base"], shipped.pixels),
        (made["normal"][..., :2], shipped.further_maps["normal"]),
        (made["packed"][..., :1], shipped.further_maps["occlusion"]),
        (made["packed"][..., 1:2], shipped.further_maps["roughness"]),
    ]
    for expected, found in pairs:
        # Another JPEG library or another sine may round differently.
        assert np.abs(expected.astype(int) - found.astype(int)).mean() < 1.0


def test_normals_of_a_height_field_point_away_from_its_bumps() -> None:
    rows, columns = np.indices((SIZE, SIZE))
    bump = 20 * np.exp(-((rows - 256) ** 2 + (columns - 256) ** 2) / 800)
    image = normal_image(bump).astype(int)
    assert image[256, 256].tolist() == image[0, 0].tolist() == [128, 128, 255]
    # Right of the bump red points right; above it, in the rows before, green points up.
    assert image[256, 276, 0] > 180
    assert image[236, 256, 1] > 180
    assert image[256, 236, 0] < 75
    assert image[276, 256, 1] < 75
    vectors = image / 127.5 - 1
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=2), 1.0, atol=0.012)


def test_patches_are_rounded_but_for_edges() -> None:
    shape = Shape()
    shape.lathe((0, 0, 0), [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 1.0, 32)
    positions, normals, uvs, indices = shape.arrays()
    assert len(positions) == len(normals) == len(uvs)
    used = np.unique(indices)
    rim = used[np.isclose(positions[used, 1], 1.0) & np.isclose(np.hypot(positions[used, 0], positions[used, 2]), 1.0)]
    assert sorted(set(np.round(normals[rim, 1], 6).tolist())) == [0.0, 1.0]
    side = rim[np.isclose(normals[rim, 1], 0.0)]
    np.testing.assert_allclose(normals[side][:, [0, 2]], positions[side][:, [0, 2]], atol=1e-6)


def test_gallery_is_small_and_whole() -> None:
    path = builtin_scene_path("gallery")
    assert path.stat().st_size < 1.3e6
    scene = load_scene(path)
    assert not scene.report.missing
    assert not scene.report.ignored
    assert scene.cameras[0].name == "gallery"
    names = {material.name: material.factors for material in scene.materials}
    assert [names[f"metal_{step}"].roughness for step in (0, 3, 6)] == [0.0, 0.5, 1.0]
    assert (names["metal_3"].metalness, names["dielectric_3"].metalness) == (1.0, 0.0)
    assert names["clearcoat"].clearcoat == 1.0
    assert names["emission"].emissive[0] == 4.0
    assert names["transmission"].transmission > 0.0
    sets = [texture for texture in scene.textures if "normal" in texture.maps]
    assert len(sets) == len(scene.textures) == len(SHOWN) + 1
    assert scene.geometry.tangents is not None


def test_tangents_of_spheres_run_along_u() -> None:
    positions, normals, tangents, uvs, indices = sphere(2.0)
    np.testing.assert_allclose(np.einsum("vk,vk->v", normals, tangents[:, :3]), 0.0, atol=1e-12)
    corners, places = positions[indices].reshape(-1, 3, 3), uvs[indices].reshape(-1, 3, 2)
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("tk,tk->t", own, normals[indices].reshape(-1, 3, 3).mean(axis=1)) > 0).all()
    # From two edges: where the surface goes with growing u, and with growing v, which is down.
    (e, f), (a, b) = (
        (corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2),
        (places[:, 1:] - places[:, :1]).transpose(1, 0, 2),
    )
    area = (a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1])[:, None]
    along = (e * b[:, 1:] - f * a[:, 1:]) / area
    upwards = -(f * a[:, :1] - e * b[:, :1]) / area
    means, normal = tangents[indices].reshape(-1, 3, 4).mean(axis=1), normals[indices].reshape(-1, 3, 3).mean(axis=1)
    assert (np.einsum("tk,tk->t", along, means[:, :3]) > 0).all()
    bitangents = np.cross(normal, means[:, :3]) * means[:, 3:]
    assert (np.einsum("tk,tk->t", upwards, bitangents) > 0).all()


def test_built_in_scenes_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert named_scene(Path("gallery")) == builtin_scene_path("gallery")
    assert named_scene(Path("other")) == Path("other")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gallery").write_bytes(b"a file of that name")
    assert named_scene(Path("gallery")) == Path("gallery")


def test_writer_aligns_views() -> None:
    writer = GlbWriter()
    writer.view(b"abc")
    writer.view(b"defgh")
    assert [view["byteOffset"] for view in writer.document["bufferViews"]] == [0, 4]
    content = writer.bytes()
    assert content[:4] == b"glTF"
    assert len(content) == int.from_bytes(content[8:12], "little")
    assert len(content) % 4 == 0
