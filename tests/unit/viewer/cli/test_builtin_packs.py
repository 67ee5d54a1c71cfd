"""Packs of built-in scenes that are encoded when they are first asked for."""

from pathlib import Path

import pytest

from ntc.codec.model import Pack
from viewer.cli import builtin_packs, encode
from viewer.locations import builtin_scene_path
from viewer.scene.load import load_scene


@pytest.mark.parametrize(("asked", "usual", "encoded"), [(None, None, []), (None, "clustered", ["clustered"])])
def test_a_builtin_scene_without_a_pack_is_encoded_for_the_window(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, asked: str | None, usual: str | None, encoded: list[str]
) -> None:
    monkeypatch.setenv("NTC_VIEWER_DATA_DIR", str(tmp_path))
    made: list[str] = []

    def encode_builtin(_scene: Path, grouping: str) -> Path:
        made.append(grouping)
        return tmp_path / "gallery.ntc"

    def open_none(_paths: list[Path]) -> dict[str, Pack]:
        return {}

    monkeypatch.setattr(encode, "encode_builtin", encode_builtin)
    monkeypatch.setattr(builtin_packs, "open_packs", open_none)
    builtin_packs.packs_with(load_scene(builtin_scene_path("gallery")), (), asked, usual)  # type: ignore[arg-type]
    assert made == encoded
