"""KTX2 images: Basis Universal, blocks and plain bytes give the pixels that went in; hostile files are refused by one line."""

import json
import sys
import tracemalloc
import zlib
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import zstandard
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat, compressed_blocks, decompress
from tests.support.gltf_builder import GltfBuilder, ktx2, noise, png
from viewer.export.images.containers import ktx2_astc
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.images import decode_image, folder_textures, read_image
from viewer.scene.ktx2 import SIGNATURE
from viewer.scene.load import build_scene, load_scene


def ramp(height: int = 16, width: int = 24) -> NDArray[np.uint8]:
    """Shades [height, width, 3] of one colour, which formats of blocks keep well."""
    across = np.add.outer(np.arange(height), np.arange(width))
    return np.dstack([across * 3 + 10, across * 3 + 60, across * 3 + 100]).astype(np.uint8)


@pytest.mark.parametrize(("vk_format", "channels"), [(9, 1), (16, 2), (23, 3), (29, 3), (37, 4), (43, 4)])
@pytest.mark.parametrize("scheme", [0, 2, 3])
def test_plain_bytes_come_back(vk_format: int, channels: int, scheme: int) -> None:
    pixels = noise(5, 7, channels)
    plain = pixels.tobytes()
    level = {0: plain, 2: zstandard.ZstdCompressor().compress(plain), 3: zlib.compress(plain)}[scheme]
    found = decode_image(ktx2(level, (7, 5), vk_format, scheme=scheme), "a.ktx2")
    expected = {1: np.repeat(pixels, 3, axis=2), 2: np.pad(pixels, ((0, 0), (0, 0), (0, 1)))}.get(channels, pixels)
    np.testing.assert_array_equal(found, expected)


def test_blocks_of_graphics_hardware_are_decoded() -> None:
    quicktex = pytest.importorskip("quicktex")
    from quicktex.s3tc.bc1 import BC1Encoder

    pixels = np.dstack([ramp(), np.full((16, 24), 255, np.uint8)])
    texture = quicktex.RawTexture.frombytes(pixels.tobytes(), 24, 16)
    found = decode_image(ktx2(BC1Encoder(10).encode(texture).tobytes(), (24, 16), 131), "a.ktx2")
    assert np.abs(found[..., :3].astype(int) - ramp()).mean() < 4


def test_a_block_of_bc7_and_of_bc5_is_decoded() -> None:
    # BC7, mode 6 with equal ends (127 and p-bit 1 in all channels): white. BC5: two blocks of BC4 whose ends are equal.
    white = ((1 << 6) | (((1 << 56) - 1) << 7) | (3 << 63)).to_bytes(16, "little")
    np.testing.assert_array_equal(decode_image(ktx2(white, (4, 4), 145), "a.ktx2")[..., :3], 255)
    two = (bytes([200, 200]) + bytes(6)) + (bytes([40, 40]) + bytes(6))
    found = decode_image(ktx2(two, (4, 4), 141), "a.ktx2")
    np.testing.assert_array_equal(found[0, 0], [200, 40, 0])


@pytest.mark.parametrize("block_format", BLOCK_FORMATS[2:])
@pytest.mark.parametrize("kind", ["srgb", "linear"])
def test_astc_of_every_block_size_is_decoded(block_format: BlockFormat, kind: Literal["srgb", "linear"]) -> None:
    pytest.importorskip("astc_encoder")
    blocks = compressed_blocks(ramp(), block_format, "medium", kind)
    file = ktx2_astc([(24, 16, blocks)], block_format, kind == "srgb")
    found = decode_image(file, "a.ktx2")
    np.testing.assert_array_equal(found, decompress(blocks, (16, 24, 4), block_format, kind))
    assert np.abs(found[..., :3].astype(int) - ramp()).mean() < 4


def test_without_its_decoder_astc_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "astc_encoder", None)
    with pytest.raises(InputError, match=r"a\.ktx2: ASTC: .*pip install 'ntc-viewer\[lab\]'"):
        decode_image(ktx2(bytes(16), (4, 4), 157), "a.ktx2")


@pytest.mark.parametrize("codec", ["etc1s", "uastc"])
def test_basis_universal_is_decoded(codec: str) -> None:
    alktx2 = pytest.importorskip("alktx2", reason="alktx2 has no wheel for this system")
    encoded = alktx2.encode_bytes_to_ktx2(png(ramp()), mime="image/png", codec=codec, quality=100, mipmaps=True)
    found = decode_image(encoded, "a.ktx2")
    assert found.shape == (16, 24, 3)
    assert np.abs(found.astype(int) - ramp()).mean() < (3 if codec == "etc1s" else 1)


@pytest.mark.parametrize("kind", ["color", "occlusion_roughness_metallic", "normal"])
def test_the_pairs_of_a_robot_show_the_same(data_folder: Path, kind: str) -> None:
    folder = data_folder / "scenes/ur3e_ktx2"
    plain, packed = (read_image(folder / f"ur3e_{kind}.{ending}") for ending in ("png", "ktx2"))
    assert plain.shape[:2] == packed.shape[:2]
    assert np.abs(plain[..., :3].astype(int) - packed[..., :3]).mean() < 4


def test_a_scene_with_basis_universal_alone_has_its_textures(data_folder: Path) -> None:
    folder = data_folder / "scenes/ur3e_ktx2"
    twin = (folder / "base.gltf").read_text()
    plain = load_scene(folder / "base.gltf")
    content = json.loads(twin)
    for texture in content["textures"]:
        texture.pop("source")
    content["extensionsRequired"] = ["KHR_texture_basisu"]
    file = parse_gltf(json.dumps(content).encode(), "twin.gltf", folder)
    packed = build_scene(file, "twin", None)
    assert not packed.report.missing
    assert [t.pixels.shape for t in packed.textures] == [t.pixels.shape for t in plain.textures]
    difference = packed.textures[0].pixels.astype(int) - plain.textures[0].pixels
    assert 0 < np.abs(difference).mean() < 2.5


def test_the_plain_image_is_preferred_to_its_compressed_copy() -> None:
    builder = GltfBuilder()
    plain, copy = builder.image(png(noise(seed=1))), builder.image(ktx2(noise(seed=2).tobytes(), (6, 4), 23))
    builder.material(plain)
    texture = builder.json["textures"][0]
    texture["extensions"] = {"KHR_texture_basisu": {"source": copy}}
    builder.drawn(builder.triangle(0))
    for expected in (noise(seed=1), noise(seed=2)):
        scene = build_scene(parse_gltf(builder.glb(), "a.glb", None), "a", None)
        np.testing.assert_array_equal(scene.textures[0].pixels, expected)
        plain_is_read = "KHR_texture_basisu: textures whose plain image is read instead" in scene.report.notes
        assert plain_is_read == ("source" in texture)
        assert plain_is_read != ("KHR_texture_basisu: textures" in scene.report.honoured)
        texture.pop("source", None)


def test_a_folder_of_ktx2_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.ktx2").write_bytes(ktx2(noise().tobytes(), (6, 4), 23))
    assert [texture.name for texture in folder_textures(tmp_path)] == ["a"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (ktx2(bytes(16 * 6), (4, 4), 145, faces=6), "a cube map in KTX2 is not read"),
        (ktx2(bytes(64), (4, 4), 37, layers=2), "an array of pictures"),
        (ktx2(bytes(64), (4, 4), 37, depth=2), "a volume"),
        (ktx2(bytes(16), (4, 0), 37), "a row of texels"),
        (ktx2(bytes(64), (0, 4), 37), "header is broken"),
        (ktx2(bytes(64), (4, 4), 37, scheme=9), "header is broken"),
        (ktx2(bytes(64), (4, 4), 37, scheme=1), "BasisLZ with VkFormat 37"),
        (ktx2(bytes(63), (4, 4), 37), "mip 0 does not hold the 64 bytes"),
        (ktx2(b"broken", (4, 4), 37, scheme=2), "mip 0 does not hold"),
        (ktx2(zlib.compress(bytes(65)), (4, 4), 37, scheme=3), "mip 0 does not hold"),
        (ktx2(bytes(15), (4, 4), 157), "mip 0 does not hold the 16 bytes"),
        (ktx2(bytes(64), (4, 4), 143), r"VkFormat 143 \(BC6H\) is not read"),
        (ktx2(bytes(64), (4, 4), 97), r"VkFormat 97 \(more than 8 bits a channel\) is not read"),
        (ktx2(bytes(64), (4, 4), 4000), "VkFormat 4000 is not read"),
        (b"\xabKTX 11\xbb\r\n\x1a\n" + bytes(64), "KTX of another version than 2 is not read; convert it"),
        (ktx2(bytes(64), (4, 4), 37, level_length=1 << 40), "truncated KTX2"),
        (ktx2(bytes(1024), (32768, 32768), 37), "the image is broken"),
        (ktx2(bytes(1024), (1 << 31, 1), 37), "sides are 1 to"),
        (ktx2(bytes(1024), (32768, 32768), 0), "the image is broken"),
        (ktx2(bytes(64), (4, 4), 0), "does not decode"),
        (SIGNATURE + bytes(20), "truncated KTX2"),
    ],
)
def test_hostile_files_are_refused(data: bytes, words: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=words):
            decode_image(data, "a.ktx2")
        assert tracemalloc.get_traced_memory()[1] < 1 << 24
    finally:
        tracemalloc.stop()


def test_a_bomb_of_zstandard_stops_at_the_pictures_size() -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 28))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="mip 0 does not hold"):
            decode_image(ktx2(bomb, (4, 4), 37, scheme=2), "a.ktx2")
        assert tracemalloc.get_traced_memory()[1] < 1 << 22
    finally:
        tracemalloc.stop()
