"""Small well-formed files that fuzzing starts from: built here, and real ones that are small enough."""

import io
import json
import math
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import DracoPy
import numpy as np
import zstandard

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig
from ntc.pack.file import write_pack
from tests.support.gltf_builder import GltfBuilder, ktx2, noise, png
from tests.support.meshopt_twins import meshopt_twin
from viewer.scene.scene_files import MESH_SUFFIXES
from viewer.state.settings import ViewerSettings

LARGEST_REAL = 1 << 13
"""Bytes: larger files of a folder of samples are left out, for speed."""
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".dds")


def scenes() -> Iterator[bytes]:
    """glTF files that together use every feature that is read."""
    from tests.fuzz.test_scene_fuzz import rich_builder

    rich = rich_builder()
    yield rich.glb()
    with tempfile.TemporaryDirectory() as folder:
        yield rich_builder().write(Path(folder) / "rich.gltf").read_bytes()
    plain = GltfBuilder()
    yield plain.drawn(plain.triangle()).glb()
    chain = GltfBuilder()
    mesh = chain.mesh(chain.triangle(chain.material(chain.image(png(noise(3, 5))))))
    for number in range(12):
        chain.add("nodes", mesh=mesh, children=[number + 1] if number < 11 else [], rotation=[0, math.sin(0.1), 0, 1])
    yield chain.glb()


def compressed_scenes() -> Iterator[bytes]:
    """glTF files compressed by Draco and by meshoptimizer."""
    yield from _draco_scenes()
    yield from _meshopt_scenes()


def moving_scenes() -> Iterator[bytes]:
    """glTF files with a skin, morph targets and animations of every interpolation."""
    for interpolation, keys in (("LINEAR", 1), ("STEP", 1), ("CUBICSPLINE", 3)):
        builder = GltfBuilder()
        joints = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]], np.uint8)
        weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [2, 2, 0, 0]], np.float32)
        primitive = builder.triangle(JOINTS_0=joints, WEIGHTS_0=weights, JOINTS_1=joints, WEIGHTS_1=weights)
        moved = builder.accessor(np.eye(3, dtype=np.float32))
        primitive["targets"] = [{"POSITION": moved}, {"POSITION": moved, "NORMAL": moved}]
        builder.add("nodes", mesh=builder.mesh(primitive, weights=[0.5, 0.0]), skin=0)
        builder.add("nodes", translation=[0, 1, 0], children=[2])
        builder.add("nodes", rotation=[0, 0.6, 0, 0.8])
        inverse = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (2, 1))
        builder.add("skins", joints=[1, 2], inverseBindMatrices=builder.accessor(inverse), skeleton=1)
        times = builder.accessor(np.array([0.5, 1.0, 3.0], np.float32))
        samplers, channels = [], []
        for path, node, width in (("translation", 1, 3), ("rotation", 2, 4), ("scale", 2, 3), ("weights", 0, 1)):
            count = 3 * keys * (2 if path == "weights" else 1)
            values = np.linspace(0.1, 1.0, count * width).reshape(count, width).astype(np.float32)
            samplers.append({"input": times, "output": builder.accessor(values), "interpolation": interpolation})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
        builder.add("animations", name="move", samplers=samplers, channels=channels)
        builder.json["scenes"] = [{"nodes": [0, 1]}]
        yield builder.glb()


def meshes() -> Iterator[bytes]:
    """Yield meshes in other formats than glTF, after a byte that names the format. The OBJ is also its material library."""
    import trimesh

    library = b"newmtl m\nKd 1 0 0\nd 0.5\nmap_Kd -s 1 1 1 a.png\nmap_Bump -bm 2 b.png\n"
    face = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/3/1\n"
    yield b"\0mtllib fuzz.mtl\n" + library + face
    box = trimesh.creation.box()
    for number, suffix in enumerate(MESH_SUFFIXES):
        data = box.export(file_type=suffix[1:])
        yield bytes([number]) + (data.encode() if isinstance(data, str) else data)
    yield bytes([MESH_SUFFIXES.index(".ply")]) + box.export(file_type="ply", encoding="ascii")
    yield bytes([MESH_SUFFIXES.index(".stl")]) + box.export(file_type="stl_ascii").encode()


def archives() -> Iterator[bytes]:
    """Zip archives with a scene."""
    plain = GltfBuilder()
    glb = plain.drawn(plain.triangle()).glb()
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", method) as archive:
            archive.writestr("model/scene.glb", glb)
            archive.writestr("model/textures/a.png", png(noise()))
        yield buffer.getvalue()


def ktx2_images() -> Iterator[bytes]:
    """KTX2 files of every kind that is read."""
    import alktx2

    for codec in ("etc1s", "uastc"):
        yield alktx2.encode_bytes_to_ktx2(png(noise(12, 12)), mime="image/png", codec=codec, quality=50)
    for vk_format, size in ((37, 64), (131, 8), (141, 16), (145, 16)):
        yield ktx2(bytes(range(size)), (4, 4), vk_format)
    yield ktx2(zstandard.ZstdCompressor().compress(bytes(range(64))), (4, 4), 37, scheme=2)
    yield ktx2(zlib.compress(bytes(range(64))), (4, 4), 43, scheme=3)


def _draco_scenes() -> Iterator[bytes]:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [2, 1, 3]], np.uint32)
    for level in (1, 10):
        data = DracoPy.encode(points, faces, compression_level=level)
        builder = GltfBuilder()
        primitive = builder.triangle()
        primitive["attributes"] = {"POSITION": primitive["attributes"]["POSITION"]}
        extension = {"bufferView": builder.view(data), "attributes": {"POSITION": 0}}
        primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
        builder.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
        yield builder.drawn(primitive).glb()


def _meshopt_scenes() -> Iterator[bytes]:
    builder = GltfBuilder()
    primitive = builder.triangle()
    primitive["indices"] = builder.accessor(np.array([0, 1, 2], np.uint16))
    data = builder.drawn(primitive).glb()
    yield meshopt_twin(data)
    yield meshopt_twin(data, "KHR_meshopt_compression", version=1)


def packs() -> Iterator[bytes]:
    """Packs of different codecs."""
    configs = (
        GridConfig(hidden_width=4),
        GridConfig(hidden_width=4, levels=1),
        GridConfig(hidden_width=4, adapters=True),
    )
    with tempfile.TemporaryDirectory() as folder:
        for number, config in enumerate(configs):
            path = Path(folder) / f"{number}.ntc"
            write_pack(path, random_pack(sizes=((8, 8), (5, 7)), config=config))
            yield path.read_bytes()


def images() -> Iterator[bytes]:
    """Images of the formats that scenes hold."""
    yield png(noise(8, 8))
    yield png(noise(5, 7, 4))
    yield png(noise(4, 4, 1).astype(np.uint16) * 257)
    try:
        from PIL import Image
    except ImportError:
        return
    picture = Image.fromarray(noise(16, 16))
    for kind in ("JPEG", "WEBP", "DDS", "BMP", "TGA", "TIFF", "GIF", "PPM"):
        buffer = io.BytesIO()
        picture.save(buffer, kind)
        yield buffer.getvalue()


def cameras() -> Iterator[bytes]:
    """Camera files."""
    entry = {"name": "front", "eye": [0, 1, 4], "target": [0, 1, 0], "fov": 50}
    yield json.dumps([entry, {**entry, "name": "side", "eye": [4.5, 1, 0]}]).encode()


def settings() -> Iterator[bytes]:
    """Settings files."""
    yield json.dumps(asdict(ViewerSettings())).encode()


def scripts() -> Iterator[bytes]:
    """Scripts."""
    from lab.benchmarks.fuzzing.scripts import script_seed

    yield script_seed()
    yield b"camera.frame-all\ncompare.mode wipe\n# a comment\nslot.path a cached\nwait settled\nexpect path cached\n"


def views() -> Iterator[bytes]:
    """Saved views."""
    from lab.benchmarks.fuzzing.scripts import view_seed

    yield view_seed()


def real(folder: Path | None, suffixes: tuple[str, ...]) -> Iterator[bytes]:
    """The small files with one of `suffixes` below `folder`, sorted by path."""
    if folder is None:
        return
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in suffixes and path.is_file() and 0 < path.stat().st_size <= LARGEST_REAL:
            yield path.read_bytes()
