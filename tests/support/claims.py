"""Files of about a kilobyte that claim four gigabytes, and a process of little memory that reads them.

`python -m tests.support.claims FOLDER` writes one JSON line for each file: its name, how it was refused, by how much the process
grew meanwhile, and how many units of work that took.
"""

import io
import json
import resource
import struct
import sys
import time
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import zstandard

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, ktx2, png_of
from tests.support.work import unit_seconds

SPARE_BYTES = 1 << 30
"""Address space that reading may take beyond what the program itself has."""
SIDE = 1 << 15
"""Texels of a side: 4 GiB of RGBA pixels."""
BYTES = 1 << 32
FILLING = bytes(range(256)) * 3


def meshopt_claim(mode: str, count: int, stride: int) -> bytes:
    """A scene with a view of `count` elements that decode to 4 GB."""
    builder = GltfBuilder()
    primitive = builder.triangle()
    view = builder.view(FILLING)
    place = dict(builder.json["bufferViews"][view])
    place |= {"byteStride": stride, "count": count, "mode": mode}
    entry = {"buffer": 0, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": place}}
    builder.json["bufferViews"][view] = entry
    builder.json["accessors"][primitive["attributes"]["POSITION"]]["bufferView"] = view
    builder.json["extensionsRequired"] = ["EXT_meshopt_compression"]
    return builder.drawn(primitive).glb()


def draco_claim(header: bytes) -> bytes:
    """A scene with a Draco mesh that begins with `header`."""
    builder = GltfBuilder()
    primitive = builder.triangle()
    extension = {"bufferView": builder.view(header + FILLING), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    return builder.drawn(primitive).glb()


def accessor_claim() -> bytes:
    """A scene whose positions are 4 GB of a buffer that is not there."""
    builder = GltfBuilder()
    primitive = builder.triangle()
    builder.json["accessors"][primitive["attributes"]["POSITION"]]["count"] = BYTES // 12
    return builder.drawn(primitive).glb()


def webp_claim(lossless: bool) -> bytes:
    """A WebP of 16384 x 16384 pixels, the most there can be: 1 GiB."""
    if lossless:
        body = b"\x2f" + struct.pack("<I", 16383 | 16383 << 14 | 1 << 28) + FILLING
        chunk = b"VP8L" + struct.pack("<I", len(body)) + body
    else:
        body = b"\x10\0\0\x9d\x01\x2a" + struct.pack("<HH", 16383, 16383) + FILLING
        chunk = b"VP8 " + struct.pack("<I", len(body)) + body
    return b"RIFF" + struct.pack("<I", 4 + len(chunk)) + b"WEBP" + chunk


def jpeg_claim() -> bytes:
    """A JPEG of 32768 x 32768 pixels without a picture."""
    frame = struct.pack(">HBHHB", 17, 8, SIDE, SIDE, 3) + b"\x01\x11\0\x02\x11\0\x03\x11\0"
    scan = struct.pack(">HB", 12, 3) + b"\x01\0\x02\0\x03\0\0\x3f\0"
    tables = b"\xff\xdb" + struct.pack(">HB", 67, 0) + bytes(range(1, 65))
    return b"\xff\xd8" + tables + b"\xff\xc0" + frame + b"\xff\xda" + scan + FILLING + b"\xff\xd9"


def zip_claim(lie: bool) -> bytes:
    """Return an archive with a scene of 4 GB of zeros, whose stated size is that or 100 bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.glb", bytes(1 << 20))
    data = bytearray(buffer.getvalue())
    for signature, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        struct.pack_into("<I", data, data.index(signature) + offset, 100 if lie else BYTES - 2)
    return bytes(data)


def zstandard_claim() -> bytes:
    """A frame that says it holds 4 GiB behind a window of 2 GiB."""
    return b"\x28\xb5\x2f\xfd" + b"\xc0" + bytes([21 << 3]) + struct.pack("<Q", BYTES) + FILLING


def claims() -> Iterator[tuple[str, bytes]]:
    """(name, content) of each file."""
    yield "vertices.meshopt.glb", meshopt_claim("ATTRIBUTES", BYTES // 256, 256)
    yield "triangles.meshopt.glb", meshopt_claim("TRIANGLES", BYTES // 12 * 3, 4)
    yield "indices.meshopt.glb", meshopt_claim("INDICES", BYTES // 4, 4)
    for kind, method in (("sequential", 0), ("edgebreaker", 1)):
        numbers = b"\x02" * method + b"\xff\xff\xff\xff\x0f" + b"\xff\xff\xff\xff\x0f"
        yield f"{kind}.draco.glb", draco_claim(b"DRACO\x02\x02\x01" + bytes([method, 0, 0]) + numbers)
    yield "accessor.glb", accessor_claim()
    yield "chunk.glb", struct.pack("<4sIIII", b"glTF", 2, BYTES - 4, BYTES - 24, 0x4E4F534A) + FILLING
    yield "plain.ktx2", ktx2(FILLING, (SIDE, SIDE), 37)
    yield "basis.ktx2", ktx2(FILLING, (SIDE, SIDE), 0)
    yield "basislz.ktx2", ktx2(FILLING, (SIDE, SIDE), 0, scheme=1)
    yield "zstandard.ktx2", ktx2(zstandard.ZstdCompressor().compress(bytes(1 << 24)), (SIDE, SIDE), 43, scheme=2)
    yield "window.ktx2", ktx2(zstandard_claim(), (4, 4), 43, scheme=2)
    yield "zlib.ktx2", ktx2(zlib.compress(bytes(1 << 19)), (SIDE, SIDE), 43, scheme=3)
    yield "bc7.ktx2", ktx2(FILLING, (SIDE, SIDE), 145)
    yield "length.ktx2", ktx2(FILLING, (4, 4), 37, level_length=BYTES)
    yield "picture.png", png_of((SIDE, SIDE), 8, 6, zlib.compress(bytes(1 << 20)))
    yield "picture.jpg", jpeg_claim()
    yield "lossy.webp", webp_claim(lossless=False)
    yield "lossless.webp", webp_claim(lossless=True)
    masks = (32, 0x41, 0, 32, 0xFF, 0xFF << 8, 0xFF << 16, 0xFF << 24)
    dds = struct.pack("<4s7I44x8I5I", b"DDS ", 124, 0x1007, SIDE, SIDE, 0, 0, 1, *masks, 0x1000, 0, 0, 0, 0)
    yield "picture.dds", dds + FILLING
    bitmap = struct.pack("<IiiHHIIIIII", 40, SIDE, SIDE, 1, 32, 0, 0, 1, 1, 0, 0)
    yield "picture.bmp", struct.pack("<2sIII", b"BM", BYTES - 1, 0, 54) + bitmap + FILLING
    yield "picture.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32768 +X 32768\n" + FILLING
    yield "said.zip", zip_claim(lie=False)
    yield "lied.zip", zip_claim(lie=True)
    properties = b"property float x\nproperty float y\nproperty float z\n"
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    yield (
        "binary.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 357913941\n" + properties + faces + FILLING,
    )
    yield "text.ply", b"ply\nformat ascii 1.0\nelement vertex 357913941\n" + properties + faces + b"0 0 0\n3 0 0 0\n"
    yield "picture.off", b"OFF\n357913941 357913941 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    yield "solid.stl", bytes(80) + struct.pack("<I", BYTES // 50) + FILLING
    yield "index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 357913941\n"


def _refusal(path: Path) -> str:
    from viewer.scene.images import IMAGE_SUFFIXES, read_image
    from viewer.scene.load import load_scene

    try:
        if path.suffix in IMAGE_SUFFIXES:
            read_image(path)
        else:
            load_scene(path)
    except InputError as error:
        return str(error)
    return ""


def main() -> None:
    """Read all files of the folder named first, in address space that is not enough for what they claim."""
    import DracoPy
    import meshopt
    import opengl_basisu
    import trimesh

    import viewer.scene.load

    del DracoPy, meshopt, opengl_basisu, trimesh, viewer
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + SPARE_BYTES, taken + SPARE_BYTES))
    for path in sorted(Path(sys.argv[1]).iterdir()):
        before, unit, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, unit_seconds(), time.process_time()
        refusal = _refusal(path)
        units = (time.process_time() - began) / unit
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        row = {"name": path.name, "refusal": refusal, "grown_kb": grown, "units": units}
        sys.stdout.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
