"""The table of maps: its order, and that what repeats it in C and in the Blender add-on says the same."""

import re
import runpy
from pathlib import Path
from typing import get_args

from ntc.codec.maps import (
    CODED_MAPS,
    CODED_PLANES,
    LARGEST_CHANNELS,
    MAP_TABLE,
    MAPS,
    TABLE_OF_MAP,
    MapName,
    Plane,
    ShownMap,
    neutral_plane,
)

ROOT = Path(__file__).parents[4]


def c_list(source: str, name: str) -> list[str]:
    """Items of the C array or enumeration `name`."""
    pattern = rf"{name}\[NTC_MOST_MAPS\] = \{{([^}}]*)\}}" if name.isupper() else rf"enum \{{([^}}]*)\}} {name};"
    found = re.search(pattern, source)
    assert found is not None, name
    return [item.strip(' "\n') for item in found[1].split(",")]


def test_the_names_of_types_are_those_of_the_table() -> None:
    assert set(get_args(MapName)) == set(CODED_MAPS)
    assert get_args(ShownMap) == MAPS
    assert get_args(Plane) == CODED_PLANES


def test_maps_of_a_plane_do_not_overlap() -> None:
    for plane in CODED_PLANES:
        maps = [each for each in MAP_TABLE if each.plane == plane]
        taken = [each.component + number for each in maps for number in range(each.channels)]
        assert len(set(taken)) == len(taken)
        assert max(taken) < 4
    assert neutral_plane("surface") == (0.5, 0.5, 1.0, 1.0)


def test_libntc_has_the_maps_of_the_table() -> None:
    source = (ROOT / "ntc/c/ntc.c").read_text()
    header = (ROOT / "ntc/c/ntc.h").read_text()
    assert c_list(source, "MAP_NAMES") == list(CODED_MAPS)
    assert c_list(source, "MAP_CHANNELS") == [str(each.channels) for each in MAP_TABLE]
    assert c_list(source, "MAP_PLANES") == [str(CODED_PLANES.index(each.plane)) for each in MAP_TABLE]
    assert c_list(header, "ntc_map") == [f"NTC_{name.upper()}" for name in CODED_MAPS]
    assert f"#define NTC_MOST_MAPS {len(CODED_MAPS)}\n" in header
    assert f"#define NTC_MOST_CHANNELS {LARGEST_CHANNELS}\n" in header


def test_the_blender_add_on_names_textures_as_the_table_does() -> None:
    program = runpy.run_path(str(ROOT / "integrations/blender/ntc_viewer/program.py"))
    for name, place in program["TEXTURE_PLACES"].items():
        assert TABLE_OF_MAP[name].gltf[0] == ".".join(place)
        # Blender reads the z of normals too.
        channels = program["COMPONENTS"][name]
        assert TABLE_OF_MAP[name].gltf_channels == channels[: len(TABLE_OF_MAP[name].gltf_channels)]
