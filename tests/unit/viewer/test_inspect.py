"""What is in a framebuffer block, and what is said over the picture."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.pack.match import PackMatch
from viewer.inspect.picking import BlockPlace, block_content
from viewer.inspect.picture_warnings import picture_warnings, scene_warnings
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.state.view_state import Slot


@pytest.mark.parametrize(
    ("share", "place", "pixels"),
    [
        ((0.0, 0.0), (0, 0), (0, 0, 8, 8)),
        ((0.5, 0.5), (3, 1), (24, 8, 32, 16)),
        ((0.999, 0.999), (6, 3), (48, 24, 50, 30)),
        ((1.0, 1.0), (6, 3), (48, 24, 50, 30)),
        ((-0.5, 2.0), (0, 3), (0, 24, 8, 30)),
    ],
)
def test_a_place_has_a_block(share: Any, place: tuple[int, int], pixels: tuple[int, ...]) -> None:
    found = BlockPlace.at(share, (8, 8), (50, 30))
    assert (found.column, found.row) == place
    assert found.pixels == pixels
    assert found.rectangle == pytest.approx((pixels[0] / 50, pixels[1] / 30, pixels[2] / 50, pixels[3] / 30))


def test_textures_are_counted_most_first_with_their_decoders() -> None:
    scene: Any = SimpleNamespace(textures=[SimpleNamespace(name=name) for name in "abc"])
    ids = np.array([[2, 2, 0], [2, -1, 1]], np.int32)
    place = BlockPlace(1, 2, (3, 2), (9, 9))
    content = block_content(ids, place, scene, {"p": (0, 1, 1), "q": (-1, -1, 5)})
    assert [(texture.name, texture.pixels) for texture in content.textures] == [("c", 3), ("a", 1), ("b", 1)]
    assert (content.decoder_count("p"), content.decoder_count("q"), content.decoder_count("none")) == (2, 1, 0)
    empty = block_content(np.full((2, 3), -1, np.int32), place, scene, {"p": (0, 1, 1)})
    assert (empty.textures, empty.decoder_count("p")) == ((), 0)


SCENE = load_scene(assets_folder() / "courtyard.glb")
COUNT = len(SCENE.textures)
PACK = random_pack(((32, 32),) * COUNT, (0,) * COUNT, seed=3)


def texts(match: PackMatch, resolution: float = 1.0) -> str:
    found = picture_warnings(SCENE, {"A": Slot("pack"), "B": Slot()}, {"pack": PACK}, {"pack": match}, resolution)
    assert all(warning.remedy for warning in found)
    return "\n".join(warning.text for warning in found)


def test_missing_files_and_colours() -> None:
    report = replace(
        SCENE.report, missing=("images[0].uri: a/wall.png: cannot be read (no); white is used", "buffer b")
    )
    bare = tuple(replace(m, texture_id=-1, factor=(1.0, 1.0, 1.0, 1.0)) for m in SCENE.materials)
    found = [warning.text for warning in scene_warnings(replace(SCENE, report=report, materials=bare))]
    assert found == [
        "missing: a/wall.png, and 1 more",
        f"{len(bare)} of {len(bare)} materials have no base colour",
    ]
    assert scene_warnings(replace(SCENE, materials=bare[:1]))[0].text == "the material has no base colour"
    patterned = tuple(replace(material, missing_base=True) for material in bare)
    assert not scene_warnings(replace(SCENE, materials=patterned))


def test_a_pack_that_is_smaller_and_one_of_another_version() -> None:
    whole = PackMatch(tuple(range(COUNT)), (), ())
    assert f"A: {COUNT} of {COUNT} textures encoded smaller than the originals" in texts(whole)
    names = tuple(texture.name for texture in SCENE.textures[:2])
    other = PackMatch((-1, -1, *range(2, COUNT)), names, names[:1])
    assert f"A: the pack is of another version of this scene (1 of {COUNT} textures differ)" in texts(other)
    assert f"A: not in the pack: 2 of {COUNT} textures" in texts(replace(other, changed=()))
