"""Files that ask for more than they hold, lead elsewhere, or never end are refused in one line, quickly, with little memory."""

import json
import os
import struct
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.claims import claims
from tests.support.gltf_builder import TRIANGLE, GltfBuilder, noise, png, png_of
from tests.support.scenes import built
from tests.support.work import growth, limited
from viewer.locations import SCENE_ROOTS_VARIABLE
from viewer.scene import bounds, images
from viewer.scene.cameras_file import read_cameras
from viewer.scene.gltf import geometry as gltf_geometry
from viewer.scene.gltf.maps import images as gltf_images
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.state.settings import SETTINGS_FILE, load_settings

MEGABYTE = 1 << 20


@contextmanager
def bounded(megabytes: float = 200.0, units: float = 100.0) -> Iterator[None]:
    """What runs inside takes no more than so much memory and work."""
    tracemalloc.start()
    try:
        with limited(units):
            yield
        assert tracemalloc.get_traced_memory()[1] < megabytes * MEGABYTE
    finally:
        tracemalloc.stop()


def refused(builder: GltfBuilder, words: str) -> None:
    with bounded(), pytest.raises(InputError, match=words):
        built(builder)


@pytest.mark.parametrize("count", [10**7, 10**9, 2**53])
def test_accessors_without_bytes(count: int) -> None:
    builder = GltfBuilder()
    primitive = builder.triangle()
    accessor = builder.json["accessors"][primitive["attributes"]["POSITION"]]
    accessor["count"] = count
    del accessor["bufferView"]
    refused(builder.drawn(primitive), "without a buffer view are more than is read")


def test_accessors_that_share_bytes_many_times(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf_geometry, "FREE_VALUES", 1 << 16)
    builder = GltfBuilder()
    positions = builder.accessor(np.tile(TRIANGLE, (2000, 1)))
    primitives = []
    for _ in range(300):
        accessor = builder.add("accessors", **builder.json["accessors"][positions])
        primitives.append({"attributes": {"POSITION": accessor}})
    with bounded(megabytes=1000), pytest.raises(InputError, match=r"the scene has more than .* vertices in"):
        built(builder.drawn(*primitives))


def test_many_primitives_of_the_same_vertices_are_bounded_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "EXACT_TOTAL", 1 << 20)
    builder = GltfBuilder()
    primitive = {"attributes": {"POSITION": builder.accessor(np.tile(TRIANGLE, (20000, 1)))}}
    with bounded(units=200.0):
        scene = built(builder.drawn(*[primitive] * 1000))
    assert scene.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]


def test_instances_out_of_proportion() -> None:
    builder = GltfBuilder()
    mesh = builder.mesh(*[builder.triangle()] * 1000)
    for _ in range(3000):
        builder.add("nodes", mesh=mesh)
    refused(builder, r"nodes\[\d+\]: the scene has more than \d+ instances")


def test_cycles_and_shared_children() -> None:
    for children in ([[1], [0]], [[0]], [[1, 1], []], [[1, 2], [2], []]):
        builder = GltfBuilder()
        mesh = builder.mesh(builder.triangle())
        for entry in children:
            builder.add("nodes", mesh=mesh, children=entry)
        builder.add("scenes", nodes=[0])
        refused(builder, "is reached twice|entries for")


@pytest.mark.slow
def test_nodes_nested_too_deep_and_very_deep() -> None:
    for depth, words in ((16384, None), (16400, "nested more than 16384 deep")):
        builder = GltfBuilder()
        for index in range(depth):
            builder.add("nodes", children=[index + 1])
        builder.add("nodes", mesh=builder.mesh(builder.triangle()))
        if words:
            refused(builder, words)
        else:
            assert len(built(builder).instances.primitive) == 1


@pytest.mark.slow
def test_tens_of_thousands_of_nodes_load_quickly() -> None:
    builder = GltfBuilder()
    mesh = builder.mesh(builder.triangle())

    def check(count: int) -> None:
        builder.json["nodes"] = [{"mesh": mesh, "translation": [index, 0, 0]} for index in range(count)]
        scene = built(builder)
        assert scene.instances.transform[:, 0, 3].tolist() == list(range(count))
        assert scene.bounds.tolist() == [[0, 0, 0], [count, 1, 0]]

    assert growth(check, 2000) < 50.0


def test_images_that_claim_more_than_they_hold() -> None:
    honest = png(noise(4, 4))
    for width, height in ((32768, 32768), (2**31 - 1, 1), (30000, 500)):
        claim = bytearray(honest)
        struct.pack_into(">II", claim, 16, width, height)
        struct.pack_into(">I", claim, 29, zlib.crc32(bytes(claim[12:29])))
        with bounded(), pytest.raises(InputError, match=r"texels|not an image|decode"):
            decode_image(bytes(claim), "claim.png")


def test_an_image_bomb_that_is_really_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "LARGE_VALUES", images.FREE_VALUES)
    # Its pixels are really there, packed as tightly as deflate can.
    data = png_of((4096, 2048), 8, 2, zlib.compress(bytes(2048 * (1 + 3 * 4096)), 9))
    assert len(data) < MEGABYTE // 16
    with bounded(megabytes=20), pytest.raises(InputError, match="4096 x 2048 texels in"):
        decode_image(data, "bomb.png")


def test_one_image_named_many_times_is_decoded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    builder = GltfBuilder()
    view = builder.view(png(noise(8, 8)))
    materials = [builder.material(builder.add("images", bufferView=view)) for _ in range(300)]
    decoded: list[str] = []

    def counting(data: bytes, name: str) -> Any:
        decoded.append(name)
        return decode_image(data, name)

    monkeypatch.setattr(gltf_images, "decode_image", counting)
    scene = built(builder.drawn(*(builder.triangle(material) for material in materials)))
    assert len(decoded) == 1
    assert len(scene.textures) == 1
    assert {material.texture_id for material in scene.materials} == {0}


def test_images_out_of_proportion_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf_images, "FREE_PIXEL_BYTES", 1 << 18)
    builder = GltfBuilder()
    pixels = np.zeros((256, 256, 3), np.uint8)
    materials = []
    for index in range(8):
        pixels[0, 1] = index + 1
        materials.append(builder.material(builder.image(png(pixels))))
    refused(builder.drawn(*(builder.triangle(material) for material in materials)), "images: hold too many texels")


def test_many_images_of_one_name() -> None:
    builder = GltfBuilder()
    count = 300
    for index in range(count):
        pixels = np.full((1, 2, 3), 7, np.uint8)
        pixels[0, 0] = index % 256, index // 256, 9
        builder.image(png(pixels), name="same")
    materials = [builder.material(image) for image in range(count)]
    scene = built(builder.drawn(*(builder.triangle(material) for material in materials)))
    names = [texture.name for texture in scene.textures]
    assert len(set(names)) == len(names) == count
    assert names[:3] == ["same", "same_2", "same_3"]


def beside(folder: Path, uri: str) -> Path:
    """A scene in `folder` whose buffer is in the file `uri`, which is not written."""
    folder.mkdir(exist_ok=True)
    builder = GltfBuilder()
    builder.drawn(builder.triangle())
    content = {**builder.json, "buffers": [{"byteLength": len(builder.data), "uri": uri}]}
    path = folder / "scene.gltf"
    path.write_text(json.dumps(content))
    (folder.parent / "outside.bin").write_bytes(bytes(builder.data))
    return path


@pytest.mark.parametrize(
    "uri",
    ["../outside.bin", "%2e%2e/outside.bin", "..\\outside.bin", "a/../../outside.bin", "/etc/passwd", "C:/x", "//h/x",
     "file:///etc/passwd", "http://h/x", "\\\\h\\x", "link.bin", "folder/outside.bin"],
)  # fmt: skip
def test_paths_that_lead_out(uri: str, tmp_path: Path) -> None:
    path = beside(tmp_path / "scene", uri)
    (path.parent / "link.bin").symlink_to(tmp_path / "outside.bin")
    (path.parent / "folder").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"scene's folder|not a relative path"):
        load_scene(path)


@pytest.mark.parametrize("uri", ["../outside.bin", "link.bin"])
def test_another_folder_can_be_allowed(uri: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = beside(tmp_path / "scene", uri)
    (path.parent / "link.bin").symlink_to(tmp_path / "outside.bin")
    monkeypatch.setenv(SCENE_ROOTS_VARIABLE, os.pathsep.join([str(tmp_path / "nowhere"), str(tmp_path)]))
    assert load_scene(path).report.used["triangles"] == 1
    monkeypatch.setenv(SCENE_ROOTS_VARIABLE, str(tmp_path / "scene"))
    with pytest.raises(InputError, match=SCENE_ROOTS_VARIABLE):
        load_scene(path)


def test_a_link_inside_the_folder_is_followed(tmp_path: Path) -> None:
    path = beside(tmp_path / "scene", "link.bin")
    (tmp_path / "outside.bin").rename(path.parent / "real.bin")
    (path.parent / "link.bin").symlink_to("real.bin")
    assert load_scene(path).report.used["triangles"] == 1


def test_pipes_devices_and_holes_are_not_read(tmp_path: Path) -> None:
    path = beside(tmp_path / "scene", "pipe.bin")
    os.mkfifo(path.parent / "pipe.bin")
    os.mkfifo(tmp_path / "pipe.glb")
    sparse = tmp_path / "sparse.glb"
    with sparse.open("wb") as file:
        file.truncate(1 << 40)
    for scene in (path, tmp_path / "pipe.glb", Path("/dev/zero"), sparse):
        with bounded(megabytes=20), pytest.raises(InputError, match=r"regular file|bytes, at most"):
            load_scene(scene)


def test_buffers_that_name_one_file_share_it(tmp_path: Path) -> None:
    path = beside(tmp_path / "scene", "big.bin")
    content = json.loads(path.read_text())
    (path.parent / "big.bin").write_bytes((tmp_path / "outside.bin").read_bytes() + bytes(8 * MEGABYTE))
    content["buffers"] = [{**content["buffers"][0], "uri": "./" * (i % 9) + "big.bin"} for i in range(200)]
    content["bufferViews"] = [{**v, "buffer": 199 - i} for i, v in enumerate(content["bufferViews"])]
    path.write_text(json.dumps(content))
    with bounded(megabytes=30):
        assert load_scene(path).report.used["triangles"] == 1


def test_a_temporary_folder_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="no temporary file could be written"):
        decode_image(png(noise()), "a.png")


def test_too_little_memory_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("viewer.scene.load.build_scene", exhausted)
    builder = GltfBuilder()
    path = builder.drawn(builder.triangle()).write(tmp_path / "a.glb")
    with pytest.raises(InputError, match="more memory than there is"):
        load_scene(path)


def test_required_extensions_without_end() -> None:
    builder = GltfBuilder()
    builder.json["extensionsRequired"] = [f"X_{index:05}" for index in range(5000)]
    with pytest.raises(InputError, match="and 4996 more is not supported") as caught:
        built(builder.drawn(builder.triangle()))
    assert len(str(caught.value)) < 200


def test_a_camera_file_of_many_cameras(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    entry = {"eye": [0, 0, 1], "target": [0, 0, 0]}

    def check(count: int) -> None:
        path.write_text(json.dumps([{"name": f"c{index}", **entry} for index in range(count)]))
        assert len(read_cameras(path)) == count

    assert growth(check, 2000) < 50.0
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="no regular file"):
        read_cameras(tmp_path / "pipe")


def test_settings_that_are_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / SETTINGS_FILE)
    assert "no regular file" in (load_settings(tmp_path)[1] or "")


def test_draco_data_that_claims_more_than_it_holds() -> None:
    builder = GltfBuilder()
    points = b"DRACO\x02\x03\x00\x00\x00\x00" + struct.pack("<i", 251_000_000)
    sequential = b"DRACO\x02\x02\x01\x00\x00\x00\x02\xff\xff\xff\x7f"
    edgebreaker = b"DRACO\x02\x02\x01\x01\x00\x00\x00\xff\xff\xff\x7f\x02"
    described = b"DRACO\x02\x02\x01\x01\x00\x80\x00\x04\x02"
    for data, words in (
        (points, "version 2.2"),
        (points.replace(b"\x02\x03", b"\x02\x02", 1), "no triangles"),
        (sequential, "268435455 vertices or triangles"),
        (edgebreaker, "268435455 vertices or triangles"),
        (described, "metadata"),
        (sequential[:-1], "truncated"),
        (b"", "truncated"),
    ):
        builder = GltfBuilder()
        primitive = builder.triangle()
        extension = {"bufferView": builder.view(data + bytes(300 if words != "truncated" else 0)), "attributes": {}}
        if words == "truncated":
            builder.json["bufferViews"][extension["bufferView"]]["byteLength"] = len(data)
        primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
        refused(builder.drawn(primitive), words)


LARGEST_FILE = 4096
MOST_GROWN_KB = 16 << 10
MOST_UNITS = 20.0
NAMES = tuple(name for name, _ in claims())


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """By file, what a process whose address space is limited wrote of it."""
    folder = tmp_path_factory.mktemp("claims")
    for name, content in claims():
        assert len(content) < LARGEST_FILE
        (folder / name).write_bytes(content)
    command = [sys.executable, "-m", "tests.support.claims", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {row["name"]: row for row in map(json.loads, done.stdout.splitlines())}


@pytest.mark.process
@pytest.mark.parametrize("name", NAMES)
def test_a_claim_is_refused_before_memory_is_taken(rows: dict[str, dict[str, Any]], name: str) -> None:
    row = rows[name]
    assert name in row["refusal"]
    assert row["refusal"].isprintable()
    assert row["grown_kb"] < MOST_GROWN_KB
    assert row["units"] < MOST_UNITS
    assert "No module" not in row["refusal"]
