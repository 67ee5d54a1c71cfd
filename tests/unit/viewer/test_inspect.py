"""What is in a framebuffer block, and what is said over the picture."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import recipe_codec
from ntc.pack.match import PackMatch
from viewer.inspect import costs
from viewer.inspect.gpu_estimate import PIXELS, estimate_lines, estimated_ms, estimated_tile_ms
from viewer.inspect.picture_warnings import picture_warnings, scene_warnings
from viewer.inspect.place_content import BlockPlace, block_content
from viewer.locations import assets_folder
from viewer.render.pass_scheduler import ToCome
from viewer.render.tile_cache.budget import TileCounts
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Slot
from viewer.ui.annotations import hint_lines


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


def test_nothing_is_said_of_a_scene_that_has_everything() -> None:
    assert picture_warnings(SCENE, {"A": Slot()}, {}, {}, 1.0) == ()


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


def test_a_preview() -> None:
    assert "preview: 50% of the pixels along each side" in texts(PackMatch(tuple(range(COUNT)), (), ()), 0.5)


def test_estimated_times_follow_the_coefficients_the_filter_and_the_path() -> None:
    packs = [random_block_pack([(64, 64)], (0,), BlockConfig(coefficients=count)) for count in (20, 90)]
    few, many = (estimated_ms(pack, Slot("p")) for pack in packs)
    assert 0.2 < few["1080p"] < many["1080p"] < 2.0
    assert many["4K"] == pytest.approx(4 * many["1080p"])
    assert estimated_ms(packs[1], Slot("p", filter="stochastic"))["4K"] < many["4K"]
    # Each pixel decodes for itself.
    assert estimated_ms(packs[1], Slot("p", "forward"))["4K"] > 2 * many["4K"]
    assert estimated_ms(packs[1], Slot("p", "cached")) == estimated_ms(packs[1], Slot("p", "on-load")) == {}
    tile_ms = estimated_tile_ms(packs[1], Slot("p", "cached"))
    # A tile has 32x32 texels, which take less than pixels that are filtered.
    assert tile_ms is not None
    assert 0 < tile_ms < 32 * 32 * many["1080p"] / PIXELS["1080p"]
    assert estimated_tile_ms(packs[1], Slot("p")) is None


def test_estimated_times_of_networks_are_those_of_the_shape_that_was_counted() -> None:
    several, shared = (
        random_pack(((32, 32),) * 2, groups, recipe_codec("best", 3, None)) for groups in ((0, 1), (0, 0))
    )
    assert estimated_ms(shared, Slot("p"))["1080p"] < estimated_ms(several, Slot("p"))["1080p"]
    for path in ("forward", "deferred", "binned"):
        assert estimated_ms(several, Slot("p", path, "fp16-accumulate"))["1080p"] > 0.5
        assert estimated_ms(several, Slot("p", path, filter="stochastic")) == {}
    assert estimated_tile_ms(several, Slot("p", "cached")) is not None
    other = random_pack(((32, 32),) * 2, (0, 1), GridConfig(hidden_width=16))
    assert estimated_ms(other, Slot("p")) == {}
    assert estimated_tile_ms(other, Slot("p", "cached")) is None


def test_lines_of_estimates_tell_what_nobody_has_counted() -> None:
    packs = {"p": random_block_pack([(64, 64)], (0,), BlockConfig()), "other": random_pack()}
    auto, cached, loaded = Slot("p", "auto"), Slot("p", "cached"), Slot("p", "on-load")
    tiles = {cached: TileCounts(resident=130, waiting=0, starved=0, kept=30, decoded=400, evicted=0)}
    heading, *lines = estimate_lines(
        packs, (auto, cached, loaded, auto, Slot()), {auto: "deferred", cached: "cached"}, tiles
    )
    assert "estimated" in heading
    assert "not measured" in heading
    milliseconds = estimated_ms(packs["p"], Slot("p"))
    assert lines[0] == (
        f"p, deferred, filter exact: {milliseconds['1080p']:.1f} ms at 1080p, {milliseconds['4K']:.1f} ms at 4K"
    )
    tile_ms = estimated_tile_ms(packs["p"], cached)
    assert tile_ms is not None
    assert lines[1] == f"p, cached: {100 * tile_ms:.3f} ms for the 100 tiles that the last view lacked"
    assert lines[2] == "p, on-load: no estimate, for its instructions were not counted"
    assert len(lines) == 3
    assert estimate_lines(packs, (Slot(),), {}, {}) == []


def test_absent_formats_are_named_with_the_line_that_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(costs, "missing_packages", lambda name: "pip install x" if name.startswith("bc") else "")
    assert costs.absent_formats() == ("bc1, bc7: pip install x",)


@pytest.mark.parametrize(
    ("part", "line"),
    [
        (ToCome("tiles", 1), "1 tile is being decoded"),
        (ToCome("tiles", 1200), "1,200 tiles are being decoded"),
        (ToCome("loads", 1, 1), "1 of 1 texture is being compressed"),
        (ToCome("textures", 3, 41), "3 of 41 textures are being read"),
    ],
)
def test_numbers_of_what_is_to_come_agree_with_their_nouns(part: ToCome, line: str) -> None:
    assert part.line == line


def test_short_lines_of_hints_keep_the_keys_that_are_needed_first() -> None:
    session = new_session(SCENE, {}, ViewerSettings(), InitialView())
    lines = hint_lines(session)
    assert list(map(len, lines)) == sorted(map(len, lines), reverse=True)
    assert lines[0].startswith("Ctrl+P commands   F1 help   M measure   F12 screenshot   orbit camera")
    assert lines[1] == "Ctrl+P commands  F1 help  M measure  F12 screenshot"
    assert lines[-1] == "Ctrl+P commands"
    session.settings = replace(session.settings, keys={"compare.measure": "", "help.keys": "F2"})
    assert hint_lines(session)[1] == "Ctrl+P commands  F2 help  F12 screenshot"
