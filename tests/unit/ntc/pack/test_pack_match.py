"""Finding a scene's textures in a pack."""

from dataclasses import replace
from pathlib import Path

import pytest

from lab.bench.random_pack import random_pack
from ntc.errors import InputError
from ntc.pack.match import match_pack, require_match

PACK = random_pack(sizes=((4, 4), (8, 8)), groups=(0, 0), hashes=("aa", "bb"))


def test_identity_is_the_hash_and_not_the_name() -> None:
    match = match_pack(
        PACK, [["bb"], ["cc"], ["aa"], ["bb"], ["dd"]], ["new name", "texture 0", "texture 1", "x", "unknown"]
    )
    assert match.texture_index == (1, -1, 0, 1, -1)
    assert match.matched == 3
    assert match.absent == ("texture 0", "unknown")
    assert match.changed == ("texture 0",)
    assert match.line() == "3 of 5 textures match; same name but other pixels: texture 0; not in the pack: unknown"


def test_a_full_match_says_only_that() -> None:
    assert match_pack(PACK, [["aa"], ["bb"]], ["a", "b"]).line() == "2 of 2 textures match"


def test_long_lists_are_cut() -> None:
    names = [f"n{index}" for index in range(8)]
    assert match_pack(PACK, [[name] for name in names], names).line().endswith("n0, n1, n2, n3, n4 and 3 more")


def test_a_pack_of_another_scene_is_bad_input() -> None:
    match = match_pack(PACK, [["cc"]], ["wall"])
    with pytest.raises(InputError, match=r"^some/other\.ntc: made for another scene than a\.glb: 0 of 1 textures"):
        require_match(replace(PACK, path=Path("some/other.ntc")), match, "a.glb")


def test_a_partial_match_and_a_scene_without_textures_are_fine() -> None:
    require_match(PACK, match_pack(PACK, [["aa"], ["cc"]], ["a", "c"]), "a.glb")
    require_match(PACK, match_pack(PACK, [], []), "a.glb")


def test_a_set_is_found_whole_or_by_its_base_colour() -> None:
    found = match_pack(PACK, [["bb", "aa"], ["xx", "aa"], ["xx", "yy"]], ["whole", "base alone", "unknown"])
    assert found.texture_index == (1, 0, -1)
