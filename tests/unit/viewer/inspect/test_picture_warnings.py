"""What is said over the picture about files that are missing, and packs that do not fit."""

from dataclasses import replace

from lab.bench.random_pack import random_pack
from ntc.pack.match import PackMatch
from viewer.inspect.picture_warnings import picture_warnings, scene_warnings
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.state.view_state import Slot

SCENE = load_scene(assets_folder() / "courtyard.glb")
COUNT = len(SCENE.textures)
PACK = random_pack(((32, 32),) * COUNT, (0,) * COUNT, seed=3)


def texts(match: PackMatch, resolution: float = 1.0) -> str:
    found = picture_warnings(SCENE, {"A": Slot("pack"), "B": Slot()}, {"pack": PACK}, {"pack": match}, resolution)
    assert all(warning.remedy for warning in found)
    return "\n".join(warning.text for warning in found)


def test_nothing_is_said_of_a_scene_that_has_everything() -> None:
    assert picture_warnings(SCENE, {"A": Slot()}, {}, {}, 1.0) == ()


def test_missing_files_and_colours() -> None:
    report = replace(SCENE.report, missing=("texture wall.png: not found; white is used", "buffer b"))
    bare = tuple(replace(m, texture_id=-1, factor=(1.0, 1.0, 1.0, 1.0)) for m in SCENE.materials)
    found = [warning.text for warning in scene_warnings(replace(SCENE, report=report, materials=bare))]
    assert found == [
        "missing: texture wall.png: not found; white is used, and 1 more",
        f"{len(bare)} of {len(bare)} materials have no base colour",
    ]
    assert scene_warnings(replace(SCENE, materials=bare[:1]))[0].text == "the material has no base colour"


def test_a_pack_that_is_smaller_and_one_of_another_version() -> None:
    whole = PackMatch(tuple(range(COUNT)), (), ())
    assert f"A: {COUNT} of {COUNT} textures encoded smaller than the originals" in texts(whole)
    names = tuple(texture.name for texture in SCENE.textures[:2])
    other = PackMatch((-1, -1, *range(2, COUNT)), names, names[:1])
    assert f"A: the pack is of another version of this scene (1 of {COUNT} textures differ)" in texts(other)
    assert f"A: 2 of {COUNT} textures are not in the pack" in texts(replace(other, changed=()))


def test_a_preview() -> None:
    assert "preview: 50% of the pixels along each side" in texts(PackMatch(tuple(range(COUNT)), (), ()), 0.5)
