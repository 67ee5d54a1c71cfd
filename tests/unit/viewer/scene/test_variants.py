"""KHR_materials_variants: the chosen variant's materials are drawn, and the textures are those of all variants."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from tests.support.spoilt_files import PromptEffects
from viewer.commands import run
from viewer.commands.command import Context
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings


def shoe(**mapping: Any) -> GltfBuilder:
    """A triangle of material 0, of material 1 under "red" and "crimson", of material 2 under "blue"."""
    builder = GltfBuilder()
    for seed in range(3):
        builder.material(builder.image(png(noise(seed=seed))))
    names = [{"name": name} for name in ("red", "blue", "crimson")]
    builder.json["extensions"] = {"KHR_materials_variants": {"variants": names}}
    builder.json["extensionsRequired"] = ["KHR_materials_variants"]
    mappings = [{"material": 1, "variants": [0, 2]}, {"material": 2, "variants": [1], **mapping}]
    primitive = builder.triangle(0)
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": mappings}}
    return builder.drawn(primitive, builder.triangle(1))


def drawn_pixels(scene: Scene) -> np.ndarray:
    return scene.textures[scene.materials[scene.primitives[0].material].texture_id].pixels


@pytest.mark.parametrize(("variant", "seed"), [("", 0), ("red", 1), ("blue", 2), ("crimson", 1)])
def test_a_variant_is_drawn_and_textures_stay_those_of_all(tmp_path: Path, variant: str, seed: int) -> None:
    scene = load_scene(shoe().write(tmp_path / "shoe.glb"), variant)
    np.testing.assert_array_equal(drawn_pixels(scene), noise(seed=seed))
    assert scene.variants == ("red", "blue", "crimson")
    assert [t.pixel_hash for t in scene.textures] == [t.pixel_hash for t in built(shoe()).textures]
    assert scene.primitives[1].material == 1


def test_an_unknown_variant_is_refused_with_the_names_that_there_are(tmp_path: Path) -> None:
    path = shoe().write(tmp_path / "shoe.glb")
    with pytest.raises(InputError, match="no variant 'green'; there are red, blue, crimson"):
        load_scene(path, "green")
    plain = GltfBuilder()
    with pytest.raises(InputError, match="the scene has no variants"):
        load_scene(plain.drawn(plain.triangle()).write(tmp_path / "plain.glb"), "red")


@pytest.mark.parametrize(
    ("mapping", "words"),
    [({"material": 3}, "material: 3 is not an index below 3"), ({"variants": [3]}, "variants: 3 is not an index")],
)
def test_broken_mappings_name_the_field(mapping: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        built(shoe(**mapping))


def test_the_command_changes_the_variant_and_keeps_what_is_open(tmp_path: Path) -> None:
    scene = load_scene(shoe().write(tmp_path / "shoe.glb"))
    context = Context(new_session(scene, {}, ViewerSettings(), InitialView(), tmp_path))
    PromptEffects(context)
    session, view = context.session, context.session.view
    run(context, "materials.variant", "blue")
    np.testing.assert_array_equal(drawn_pixels(session.scene), noise(seed=2))
    assert session.view == view
    run(context, "materials.variant", "default")
    assert session.scene.variant == ""


def test_another_variant_or_moment_reads_no_image_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    builder = shoe()
    times, places = np.array([0, 2], np.float32), np.array([[0, 0, 0], [4, 0, 0]], np.float32)
    sampler = {"input": builder.accessor(times), "output": builder.accessor(places)}
    builder.add(
        "animations", samplers=[sampler], channels=[{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    )
    scene = load_scene(builder.write(tmp_path / "shoe.glb"))
    context = Context(new_session(scene, {}, ViewerSettings(), InitialView(), tmp_path))
    PromptEffects(context)
    decoded: list[str] = []

    def counted(data: bytes, name: str) -> Any:
        decoded.append(name)
        return decode_image(data, name)

    monkeypatch.setattr("viewer.scene.gltf.maps.images.decode_image", counted)
    run(context, "materials.variant", "blue")
    np.testing.assert_array_equal(drawn_pixels(context.session.scene), noise(seed=2))
    run(context, "animation.time", 1.0)
    session = context.session
    assert session.scene.motion is not None
    stand = session.scene.motion.at(session.view.pose)
    np.testing.assert_array_equal(stand.instances.transform[0, :3, 3], [2, 0, 0])
    assert (session.scene.variant, session.scene.report) == ("blue", scene.report)
    assert decoded == []


def test_a_file_that_has_changed_is_read_whole(tmp_path: Path) -> None:
    path = shoe().write(tmp_path / "shoe.glb")
    before = load_scene(path)
    changed = GltfBuilder()
    changed.material(changed.image(png(noise(8, 8, seed=9))))
    changed.drawn(changed.triangle(0)).write(path)
    scene = load_scene(path, before=before)
    assert [len(scene.materials), len(scene.textures)] == [1, 1]
    np.testing.assert_array_equal(drawn_pixels(scene), noise(8, 8, seed=9))


def test_the_names_are_told_by_info(tmp_path: Path) -> None:
    text = json.dumps(built(shoe()).report.honoured)
    assert "KHR_materials_variants: variants (3)" in text
