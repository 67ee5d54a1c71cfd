"""Settings survive, and a broken file does no harm."""

from dataclasses import replace
from pathlib import Path

import pytest

from viewer.commands import key_table_markdown
from viewer.state.settings import SETTINGS_FILE, ViewerSettings, load_settings, save_settings

COMMANDS_PAGE = Path(__file__).resolve().parents[4] / "docs" / "reference" / "commands.md"


def test_round_trip(tmp_path: Path) -> None:
    settings = replace(ViewerSettings(), camera_mode="fly", anisotropy=8, wipe_position=0.25, window_size=(900, 500))
    settings = replace(settings, texel_filter="stochastic")
    save_settings(tmp_path / "new", settings)
    assert load_settings(tmp_path / "new") == (settings, None)


def test_no_file_gives_the_defaults(tmp_path: Path) -> None:
    assert load_settings(tmp_path) == (ViewerSettings(), None)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"anisotropy": 3}',
        '{"anisotropy": true}',
        '{"wipe_position": 7}',
        '{"wipe_position": NaN}',
        '{"window_size": [1]}',
        '{"camera_mode": 5}',
        "[" * 100000,
    ],
)
def test_a_broken_file_gives_the_defaults_and_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / SETTINGS_FILE).write_text(content)
    settings, problem = load_settings(tmp_path)
    assert settings == ViewerSettings()
    assert problem is not None
    assert "\n" not in problem
    assert SETTINGS_FILE in problem


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ('{"fov_degrees": 200}', "fov_degrees: Expected number <= 120"),
        ('{"theme": "pink"}', "theme: Invalid enum value 'pink', must be one of dark, light"),
        ('{"anisotropy": 3}', "anisotropy: must be one of 1, 2, 4, 8, 16"),
        ('{"texel_filter": "box"}', "texel_filter: Invalid enum value 'box', must be one of exact, stochastic"),
        ('{"window_size": [900, 100]}', "window_size[1]: Expected whole number >= 200"),
        ('{"hidden_panels": [5]}', "hidden_panels[0]: Expected text"),
    ],
)
def test_the_line_about_a_broken_file_names_the_field_and_the_remedy(tmp_path: Path, content: str, named: str) -> None:
    (tmp_path / SETTINGS_FILE).write_text(content)
    _, problem = load_settings(tmp_path)
    assert problem is not None
    assert named in problem
    assert "it will be overwritten when the window closes; using default settings" in problem


def test_unknown_fields_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / SETTINGS_FILE).write_text('{"anisotropy": 4, "of_a_later_version": 1}')
    assert load_settings(tmp_path) == (replace(ViewerSettings(), anisotropy=4), None)
    (tmp_path / SETTINGS_FILE).write_text('{"anisotropy": 4, "half a pair \\ud800": "\\ud800"}')
    assert load_settings(tmp_path) == (replace(ViewerSettings(), anisotropy=4), None)


def test_the_page_of_commands_lists_every_key() -> None:
    text = COMMANDS_PAGE.read_text()
    table = text[text.index("<!-- keys -->") + len("<!-- keys -->") : text.index("<!-- end of keys -->")]
    assert table.strip() == key_table_markdown()
