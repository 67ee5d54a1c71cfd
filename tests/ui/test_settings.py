"""Settings survive, and a broken file does no harm."""

from dataclasses import replace
from pathlib import Path

import pytest

from viewer.commands import key_table_markdown
from viewer.state.settings import SETTINGS_FILE, ViewerSettings, load_settings, save_settings

README = Path(__file__).resolve().parents[2] / "README.md"


def test_round_trip(tmp_path: Path) -> None:
    settings = replace(ViewerSettings(), camera_mode="fly", anisotropy=8, wipe_position=0.25, window_size=(900, 500))
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


def test_unknown_fields_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / SETTINGS_FILE).write_text('{"anisotropy": 4, "of_a_later_version": 1}')
    assert load_settings(tmp_path) == (replace(ViewerSettings(), anisotropy=4), None)


def test_the_readme_lists_every_key() -> None:
    text = README.read_text()
    table = text[text.index("<!-- keys -->") + len("<!-- keys -->") : text.index("<!-- end of keys -->")]
    assert table.strip() == key_table_markdown()
