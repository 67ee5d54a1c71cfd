"""Images in and out, also KTX2; read when they are needed, and kept in bounded memory."""

import sys
import threading
import tracemalloc
import zlib
from concurrent.futures import CancelledError, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenImageIO
import pytest
import zstandard
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb, srgb_to_linear
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat, compressed_blocks, decompress
from tests.support.gltf_builder import GltfBuilder, ktx2, noise, png
from tests.support.scenes import built
from viewer.export.images import ktx2_astc
from viewer.locations import cache_folder
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.images import decode_image, folder_textures, read_image, write_png
from viewer.scene.ktx2 import SIGNATURE
from viewer.scene.load import build_scene, load_scene
from viewer.scene.model import Scene
from viewer.scene.pixels import PixelCache
from viewer.scene.source_textures import reduce_texture, source_textures


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png_of_every_channel_count(tmp_path: Path, channels: int) -> None:
    pixels = noise(channels=channels)
    expected = np.concatenate([np.repeat(pixels[..., :1], 3, 2), pixels[..., 1:]], 2) if channels < 3 else pixels
    np.testing.assert_array_equal(decode_image(png(pixels), "test"), expected)
    write_png(tmp_path / "new folder" / "a.png", pixels)
    np.testing.assert_array_equal(read_image(tmp_path / "new folder" / "a.png"), expected)


def test_sixteen_bits_become_eight(tmp_path: Path) -> None:
    pixels = noise().astype(np.uint16) * 257
    np.testing.assert_array_equal(decode_image(png(pixels), "test"), noise())
    write_png(tmp_path / "a.png", pixels)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), noise())


def test_colours_are_not_multiplied_by_alpha() -> None:
    pixels = noise(channels=4)
    pixels[0, :, 3] = 0
    np.testing.assert_array_equal(decode_image(png(pixels), "test"), pixels)


@pytest.mark.parametrize("suffix", [".jpg", ".webp", ".tif", ".bmp", ".tga", ".exr"])
def test_other_formats(tmp_path: Path, suffix: str) -> None:
    ramp = np.linspace(30, 220, 32).astype(np.uint8)
    pixels = np.stack([np.tile(ramp, (32, 1)), np.tile(ramp[:, None], (1, 32)), np.full((32, 32), 90, np.uint8)], 2)
    path = tmp_path / f"a{suffix}"
    stored = srgb_to_linear(pixels / 255.0).astype(np.float32) if suffix == ".exr" else pixels
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output is not None
    spec = OpenImageIO.ImageSpec(32, 32, 3, "float" if suffix == ".exr" else "uint8")
    assert output.open(str(path), spec)
    assert output.write_image(stored)
    assert output.close()
    read = decode_image(path.read_bytes(), f"picture{suffix}").astype(int)
    assert np.abs(read - pixels).mean() < (3.0 if suffix in (".jpg", ".webp") else 0.6)


@pytest.mark.parametrize("data", [b"", b"x", b"\x89PNG\r\n\x1a\n", png(noise(64, 64))[:600], b"\xff\xd8\xff\xe0abc"])
def test_broken_images_are_input_errors(data: bytes) -> None:
    with pytest.raises(InputError, match=r"broken\.png"):
        decode_image(data, "broken.png")


def test_write_png_leaves_nothing_behind_on_failure(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match="cannot be written"):
        write_png(tmp_path / "file" / "a.png", noise())
    with pytest.raises(ValueError, match="must be"):
        write_png(tmp_path / "a.png", np.zeros((2, 2, 3), np.float32))  # type: ignore[arg-type]
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_folder_textures(tmp_path: Path) -> None:
    write_png(tmp_path / "wood" / "oak.png", noise(seed=1))
    write_png(tmp_path / "wood" / "grey.png", np.full((4, 4, 3), 7, np.uint8))
    write_png(tmp_path / "cut.png", noise(channels=4))
    opaque = noise(channels=4, seed=2)
    opaque[..., 3] = 255
    write_png(tmp_path / "opaque.png", opaque)
    (tmp_path / "notes.txt").write_text("no image")
    (tmp_path / "z.ktx2").write_bytes(ktx2(noise().tobytes(), (6, 4), 23))
    textures = folder_textures(tmp_path)
    assert [(t.name, t.category, t.pixels.shape[2]) for t in textures] == [
        ("cut", None, 4),
        ("opaque", None, 3),
        ("wood/oak", "wood", 3),
        ("z", None, 3),
    ]
    assert textures[2].pixel_hash == hash_pixels(noise(seed=1))
    (tmp_path / "broken.png").write_bytes(b"broken")
    (tmp_path / "empty").mkdir()
    for folder, words in ((tmp_path, r"broken\.png"), (tmp_path / "empty", "empty"), (tmp_path / "nowhere", "nowhere")):
        with pytest.raises(InputError, match=words):
            folder_textures(folder)


def test_reduction_is_a_box_filter_in_linear_light() -> None:
    pixels = noise(8, 16)
    small = reduce_texture(SourceTexture("a", pixels, "hash"), 8)
    assert small.size == (8, 4)
    assert small.pixel_hash == "hash"
    linear = srgb_to_linear(pixels / 255.0).reshape(4, 2, 8, 2, 3).mean(axis=(1, 3))
    np.testing.assert_array_equal(small.pixels, np.rint(linear_to_srgb(linear) * 255))


def test_reduction_by_any_ratio_keeps_the_mean() -> None:
    pixels = noise(37, 50, channels=4)
    texture = SourceTexture("a", pixels, "hash")
    small = reduce_texture(texture, 20)
    assert small.pixels.shape == (15, 20, 4)
    means = [srgb_to_linear(image[..., :3] / 255.0).mean(axis=(0, 1)) for image in (pixels, small.pixels)]
    np.testing.assert_allclose(means[0], means[1], atol=2e-3)
    assert pixels[..., 3].mean() == pytest.approx(small.pixels[..., 3].mean(), abs=0.3)
    assert reduce_texture(texture, 50) is texture
    assert reduce_texture(texture, 1).size == (1, 1)
    with pytest.raises(InputError):
        reduce_texture(texture, 0)


def test_source_textures_follow_the_texture_ids() -> None:
    builder = GltfBuilder()
    materials = [builder.material(builder.image(png(noise(8, 8, 4, seed)))) for seed in (1, 2)]
    builder.json["textures"][1]["sampler"] = builder.add("samplers", wrapS=33071, wrapT=33648)
    builder.json["materials"][0]["alphaMode"] = "MASK"
    scene = built(builder.drawn(*(builder.triangle(material) for material in materials)))
    sources = source_textures(scene, None)
    assert [source.pixel_hash for source in sources] == [texture.pixel_hash for texture in scene.textures]
    assert [source.wrap for source in sources] == [("repeat", "repeat"), ("clamp", "mirror")]
    np.testing.assert_array_equal(sources[0].pixels, scene.textures[0].pixels)
    assert [source.size for source in source_textures(scene, 4)] == [(4, 4), (4, 4)]


@pytest.mark.parametrize(("largest", "refused"), [(1.0, False), (1.0005, False), (4.0, True), (np.inf, True)])
def test_values_above_one_are_refused(tmp_path: Path, largest: float, refused: bool) -> None:
    values = np.full((8, 8, 3), 0.5, np.float32)
    values[3, 4, 1] = largest
    path = str(tmp_path / "a.exr")
    output = OpenImageIO.ImageOutput.create(path)
    assert output is not None
    output.open(path, OpenImageIO.ImageSpec(8, 8, 3, "float"))
    output.write_image(values)
    output.close()
    if refused:
        with pytest.raises(InputError, match=r"a\.exr: holds values up to (4|inf); textures are colours from 0 to 1"):
            read_image(tmp_path / "a.exr")
    else:
        assert read_image(tmp_path / "a.exr")[3, 4, 1] == 255


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
    with pytest.raises(InputError, match=r"a\.ktx2: ASTC: .*pip install '.*\[lab\]'"):
        decode_image(ktx2(bytes(16), (4, 4), 157), "a.ktx2")


@pytest.mark.parametrize("codec", ["etc1s", "uastc"])
def test_basis_universal_is_decoded(codec: str) -> None:
    alktx2 = pytest.importorskip("alktx2", reason="alktx2 has no wheel for this system")
    encoded = alktx2.encode_bytes_to_ktx2(png(ramp()), mime="image/png", codec=codec, quality=100, mipmaps=True)
    found = decode_image(encoded, "a.ktx2")
    assert found.shape == (16, 24, 3)
    assert np.abs(found.astype(int) - ramp()).mean() < (3 if codec == "etc1s" else 1)


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
        (ktx2(zstandard.ZstdCompressor().compress(bytes(1 << 28)), (4, 4), 37, scheme=2), "mip 0 does not hold"),
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


COUNT = 12


def scene_of_images(folder: Path, count: int = COUNT) -> Path:
    """A scene of `count` image files, some with alpha, one constant, two alike; each third a set with a normal map."""
    builder = GltfBuilder()
    parts = []
    for number in range(count):
        pixels = noise(8, 8, 4 if number % 4 == 1 else 3, number)
        pixels = noise(8, 8, 3, 0) if number == 3 else pixels
        pixels = np.full((8, 8, 3), 7, np.uint8) if number == 2 else pixels
        (folder / f"{number}.png").write_bytes(png(pixels))
        material = builder.material(builder.add("images", uri=f"{number}.png"), alphaMode="MASK")
        if number % 3 == 0:
            (folder / f"{number}n.png").write_bytes(png(noise(4, 4, 3, 50 + number)))
            normal = builder.add("textures", source=builder.add("images", uri=f"{number}n.png"))
            builder.json["materials"][material]["normalTexture"] = {"index": normal}
        parts.append(builder.triangle(material, TEXCOORD_0=np.zeros((3, 2), np.float32)))
    return builder.drawn(*parts).write(folder / "scene.gltf", uri="scene.bin")


def content(scene: Scene) -> list[tuple[Any, ...]]:
    """All that there is to know of its textures."""
    return [
        (
            (texture.name, texture.size, texture.has_alpha, texture.pixel_hash, texture.set_hash, texture.maps),
            texture.pixels.tobytes(),
            None if texture.alpha is None else texture.alpha.tobytes(),
            {name: pixels.tobytes() for name, pixels in texture.further_maps.items()},
        )
        for texture in scene.textures
    ]


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Labels of the images that were decoded; facts of every scene are kept."""
    names: list[str] = []

    def counting(data: bytes, name: str) -> np.ndarray:
        names.append(name)
        return decode_image(data, name)

    monkeypatch.setattr("viewer.scene.gltf.maps.images.decode_image", counting)
    monkeypatch.setattr("viewer.scene.gltf.maps.material_sets.CACHED_FROM_BYTES", 1)
    monkeypatch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path / "cache"))
    return names


def test_a_scene_that_was_open_before_decodes_what_is_asked_for(tmp_path: Path, decoded: list[str]) -> None:
    path = scene_of_images(tmp_path)
    first = load_scene(path)
    expected, images = content(first), len(decoded)
    decoded.clear()
    again = load_scene(path)
    assert decoded == []
    assert again.materials == first.materials
    assert again.report == first.report
    _ = again.textures[0].pixels, again.textures[0].pixels
    assert len(decoded) == 1
    assert content(again) == expected
    assert len(decoded) < images


def test_with_little_memory_the_pixels_are_the_same(
    tmp_path: Path, decoded: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scene_of_images(tmp_path)
    expected = content(load_scene(path))
    monkeypatch.setattr("viewer.scene.gltf.maps.material_sets.PixelCache", partial(PixelCache, 400))
    scene = load_scene(path)
    assert content(scene) == expected == content(scene)
    assert len(decoded) > COUNT


def test_an_image_that_has_changed_since_is_found_out_about_anew(tmp_path: Path, decoded: list[str]) -> None:
    path = scene_of_images(tmp_path)
    before = load_scene(path)
    (tmp_path / "0.png").write_bytes(png(noise(8, 8, 3, 99)))
    decoded.clear()
    after = load_scene(path)
    assert decoded[0].endswith("(0.png)")
    assert before.textures[0].pixel_hash != after.textures[0].pixel_hash
    np.testing.assert_array_equal(after.textures[0].pixels, noise(8, 8, 3, 99))


@pytest.mark.parametrize("change", ["gone", "smaller"])
def test_an_image_that_changes_while_the_scene_is_open_is_an_error(
    tmp_path: Path, decoded: list[str], change: str
) -> None:
    path = scene_of_images(tmp_path)
    load_scene(path)
    scene = load_scene(path)
    if change == "gone":
        (tmp_path / "0.png").unlink()
    else:
        (tmp_path / "0.png").write_bytes(png(noise(4, 4)))
    with pytest.raises(InputError, match=r"images\[0\] \(0\.png\): .*; open (it|the scene) again"):
        _ = scene.textures[0].pixels
    assert decoded


@pytest.mark.parametrize("damage", [b"", b"{", b'{"version": "0", "images": {}, "sets": {}}', b"\xff\xfe"])
def test_a_broken_file_of_facts_is_not_used(tmp_path: Path, decoded: list[str], damage: bytes) -> None:
    path = scene_of_images(tmp_path)
    expected = content(load_scene(path))
    (facts,) = cache_folder("images").iterdir()
    facts.write_bytes(damage)
    decoded.clear()
    assert content(load_scene(path)) == expected
    assert len(decoded) >= COUNT


def test_progress_is_told_and_can_end_the_opening(tmp_path: Path, decoded: list[str]) -> None:
    class Report:
        def __init__(self, most: int) -> None:
            self.told: list[tuple[int, int]] = []
            self._most = most

        def progress(self, done: int, of: int) -> None:
            self.told.append((done, of))
            if len(self.told) == self._most:
                raise CancelledError

    path = scene_of_images(tmp_path, 40)
    report = Report(2)
    with pytest.raises(CancelledError):
        load_scene(path, report=report)
    assert len(decoded) < 40
    assert not cache_folder("images").exists()
    whole = Report(1000)
    load_scene(path, report=whole)
    assert whole.told[0][0] == 1
    assert whole.told[-1][0] == whole.told[-1][1]


def block(size: int) -> np.ndarray:
    return np.zeros(size, np.uint8)


def test_what_was_not_used_for_longest_goes_first() -> None:
    cache = PixelCache(100)
    first = cache.get("a", lambda: block(40))
    cache.get("b", lambda: block(40))
    assert cache.get("a", lambda: block(1)) is first
    cache.get("c", lambda: block(40))
    assert cache.nbytes == 80
    assert cache.get("a", lambda: block(1)) is first
    assert len(cache.get("b", lambda: block(2))) == 2
    # What is too large is given but not kept, and what is offered removes nothing.
    assert len(cache.get("d", lambda: block(101))) == 101
    cache.offer("e", block(60))
    assert cache.nbytes == 82
    made = cache.made
    cache.offer("f", block(10))
    assert len(cache.get("f", lambda: block(1))) == 10
    assert (cache.made, cache.nbytes) == (made, 92)


def test_what_several_threads_ask_for_is_made_once() -> None:
    cache, began = PixelCache(1000), threading.Barrier(4)
    made: list[int] = []

    def make() -> np.ndarray:
        made.append(1)
        return block(10)

    def ask(_: int) -> np.ndarray:
        began.wait()
        return cache.get("a", make)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(ask, range(4)))
    assert len(made) == cache.made == 1
    assert all(each is found[0] for each in found)


def test_many_threads_stay_within_the_bytes() -> None:
    cache = PixelCache(500)
    keys = np.random.default_rng(0).integers(0, 40, 2000)
    with ThreadPoolExecutor(8) as pool:
        sizes = list(pool.map(lambda key: (len(cache.get(int(key), lambda: block(20 + int(key)))), int(key)), keys))
    assert all(size == 20 + key for size, key in sizes)
    assert cache.nbytes <= 500
