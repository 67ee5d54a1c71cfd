"""Images are read when they are needed, and what is known of them is kept on disk."""

from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.locations import images_cache
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.pixels.pixel_cache import PixelCache

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
            texture.name,
            texture.size,
            texture.has_alpha,
            texture.pixel_hash,
            texture.set_hash,
            texture.maps,
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
    monkeypatch.setattr("viewer.scene.gltf.maps.material_sets.KEPT_FROM_BYTES", 1)
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
    (facts,) = images_cache().iterdir()
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
    assert not images_cache().exists()
    whole = Report(1000)
    load_scene(path, report=whole)
    assert whole.told[0][0] == 1
    assert whole.told[-1][0] == whole.told[-1][1]
