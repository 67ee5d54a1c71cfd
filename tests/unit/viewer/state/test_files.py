"""Settings and views survive being written and read; whatever else is read is refused in one line."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ntc.errors import InputError
from viewer.scene.model import AnimationFacts, Camera, Pose
from viewer.state.settings import SETTINGS_FILE, ViewerSettings, load_settings, save_settings
from viewer.state.view_file import LARGEST_VIEW, SavedView, parse_view, view_json, with_known_pose, with_open_sources
from viewer.state.view_state import Overlay, Slot, ViewState, Zoom


def test_settings_come_back_and_are_the_defaults_without_a_file(tmp_path: Path) -> None:
    assert load_settings(tmp_path) == (ViewerSettings(), None)
    settings = replace(ViewerSettings(), camera_mode="fly", anisotropy=8, wipe_position=0.25, window_size=(900, 500))
    settings = replace(settings, texel_filter="stochastic")
    save_settings(tmp_path / "new", settings)
    assert load_settings(tmp_path / "new") == (settings, None)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        *((content, "") for content in ("", "{", "[]", '{"anisotropy": true}', "[" * 100000)),
        ('{"wipe_position": 7}', "wipe_position"),
        ('{"wipe_position": NaN}', ""),
        ('{"window_size": [1]}', "window_size"),
        ('{"camera_mode": 5}', "camera_mode"),
        ('{"fov_degrees": 200}', "fov_degrees: Expected number <= 120"),
        ('{"theme": "pink"}', "theme: Invalid enum value 'pink', must be one of dark, light"),
        ('{"anisotropy": 3}', "anisotropy: Invalid enum value 3, must be one of 1, 2, 4, 8, 16"),
        ('{"texel_filter": "box"}', "texel_filter: Invalid enum value 'box', must be one of exact, stochastic"),
        ('{"window_size": [900, 100]}', "window_size[1]: Expected whole number >= 200"),
        ('{"hidden_panels": [5]}', "hidden_panels[0]: Expected text"),
    ],
)
def test_a_broken_file_gives_the_defaults_and_a_line_with_the_remedy(tmp_path: Path, content: str, named: str) -> None:
    (tmp_path / SETTINGS_FILE).write_text(content)
    settings, problem = load_settings(tmp_path)
    assert settings == ViewerSettings()
    assert problem is not None
    assert "\n" not in problem
    assert SETTINGS_FILE in problem
    assert named in problem
    assert "it will be overwritten when the window closes; using default settings" in problem


def test_unknown_fields_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / SETTINGS_FILE).write_text('{"anisotropy": 4, "of_a_later_version": 1}')
    assert load_settings(tmp_path) == (replace(ViewerSettings(), anisotropy=4), None)
    (tmp_path / SETTINGS_FILE).write_text('{"anisotropy": 4, "half a pair \\ud800": "\\ud800"}')
    assert load_settings(tmp_path) == (replace(ViewerSettings(), anisotropy=4), None)


PLAIN = SavedView("courtyard", ViewState(Camera("all", (0.0, 0.0, 5.0), (0.0, 0.0, 0.0)), (640, 360)), 1.0, {})
CAMERA = Camera("north", (1.0, 2.0, 3.0), (0.5, 0.25, 0.125), (0.0, 0.0, 1.0), 35.5, 4.0, 0.5, 99.0)
RICH = SavedView(
    "courtyard",
    replace(
        PLAIN.view,
        camera=CAMERA,
        slot_a=Slot("clustered", "cached", "fp16"),
        slot_b=Slot("single", "auto", filter="stochastic"),
        compare="wipe",
        wipe_position=0.3,
        overlay=Overlay("divergence", 0.25, "viridis", "16x4"),
        zoom=Zoom(4.0, (0.25, 0.75)),
        anisotropy=8,
        pose=Pose("walk", 1.25),
    ),
    0.5,
    {"one": replace(CAMERA, name="one"), "two": Camera("two", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))},
)


def test_round_trip() -> None:
    assert parse_view(view_json(RICH), "v", PLAIN) == RICH
    assert parse_view(view_json(PLAIN), "v", replace(PLAIN, bookmarks=RICH.bookmarks)) == PLAIN
    # Absent fields stay, and unknown ones are ignored.
    assert parse_view('{"format": "ntc-viewer view", "of a later version": [1]}', "v", RICH) == RICH


def test_sources_that_are_not_open_leave_the_slot_as_it_was() -> None:
    view, missing = with_open_sources(RICH.view, PLAIN.view, ("reference", "single"))
    assert missing == ["clustered"]
    assert (view.slot_a, view.slot_b) == (PLAIN.view.slot_a, RICH.view.slot_b)


def test_a_pose_of_an_animation_that_the_scene_has_not_is_rest() -> None:
    assert with_known_pose(RICH.view, (AnimationFacts("walk", 2.0),)) == RICH.view
    assert with_known_pose(RICH.view, (AnimationFacts("run", 2.0),)).pose is None
    assert with_known_pose(PLAIN.view, ()) == PLAIN.view


def _with(path: str, value: Any) -> str:
    content = json.loads(view_json(RICH))
    *parents, last = path.split("/")
    at = content
    for name in parents:
        at = at[int(name)] if isinstance(at, list) else at[name]
    at[last] = value
    return json.dumps(content)


HOSTILE: dict[str, list[Any]] = {
    "format": ["something else"],
    "version": [2, True],
    "camera": [[]],
    "camera/eye": [[1, 2], [1, 2, float("nan")], [1, 2, float("inf")], [1, 2, True], [0.5, 0.25, 0.125]],
    "camera/up": [[0, 0, 0]],
    "camera/fov": [180, "60"],
    "camera/near": [-1],
    "camera/far": [0.25],
    "camera/name": [""],
    "slots/a/source": [5],
    "slots/a/path": ["fast", ["cached"]],
    "slots/b": ["reference"],
    "compare": [{}],
    "divider": [1.5, float("nan")],
    "overlay/opacity": [-0.1],
    "overlay/palette": ["rainbow"],
    "overlay/block": ["1x1"],
    "zoom/factor": [1e9],
    "zoom/x": [float("nan")],
    "lighting/environment": [""],
    "pose": [3],
    "pose/seconds": [-1, float("nan")],
    "pose/animation": [None],
    "anisotropy": [3, True],
    "resolution": [0, 10**400],
    "bookmarks": [{}, [1], [{}], [{"name": "one"}, {"name": "one"}], [{"name": "x"}] * 1001],
    "bookmarks/0/eye": [None],
}


@pytest.mark.parametrize(("path", "value"), [(path, value) for path in HOSTILE for value in HOSTILE[path]])
def test_hostile_fields_are_one_line(path: str, value: Any) -> None:
    with pytest.raises(InputError) as caught:
        parse_view(_with(path, value), "v", PLAIN)
    message = str(caught.value)
    assert message.startswith("v")
    assert len(message) < 300
    assert path.split("/", 1)[0] in message


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", "5", "[" * 100000, "{}", "\x00", "9" * 5000, "x" * (LARGEST_VIEW + 1)]
)
def test_what_is_no_view_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match=r"^v"):
        parse_view(text, "v", PLAIN)
