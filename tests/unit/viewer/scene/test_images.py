"""Images in and out, folders of textures, reduced copies."""

import zlib
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from ntc.codec.color import linear_to_srgb, srgb_to_linear
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.scene.images import decode_image, folder_textures, read_image, write_png
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


def test_a_small_file_of_a_huge_image_is_refused_before_memory_is_taken() -> None:
    header = bytearray(png(noise(2, 2)))
    header[16:24] = (30000).to_bytes(4, "big") * 2
    header[29:33] = zlib.crc32(bytes(header[12:29])).to_bytes(4, "big")
    with pytest.raises(InputError, match=r"bomb\.png"):
        decode_image(bytes(header), "bomb.png")


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
    textures = folder_textures(tmp_path)
    assert [(t.name, t.category, t.pixels.shape[2]) for t in textures] == [
        ("cut", None, 4),
        ("opaque", None, 3),
        ("wood/oak", "wood", 3),
    ]
    assert textures[2].pixel_hash == hash_pixels(noise(seed=1))
    (tmp_path / "broken.png").write_bytes(b"broken")
    with pytest.raises(InputError, match=r"broken\.png"):
        folder_textures(tmp_path)


def test_folders_without_images(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError):
            folder_textures(folder)


def test_srgb_round_trip() -> None:
    values = np.arange(256) / 255.0
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-6)


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


def test_reduction_keeps_the_alpha_of_two_channels_linear() -> None:
    pixels = np.zeros((2, 2, 2), np.uint8)
    pixels[0] = 200
    small = reduce_texture(SourceTexture("a", pixels, "hash"), 1).pixels
    assert small[0, 0, 1] == 100
    assert small[0, 0, 0] > 100


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
