"""Scenes of many textures: made the same each time, and the table in the docs is that of the measurement."""

from pathlib import Path

import numpy as np

from lab.benchmarks.many_textures.__main__ import table
from lab.benchmarks.many_textures.generate import write_scene
from viewer.scene.cameras_file import with_cameras_beside
from viewer.scene.load import load_scene

ROOT = Path(__file__).resolve().parents[3]


def test_a_made_scene_opens_whole(tmp_path: Path) -> None:
    paths = [write_scene(tmp_path / name, 10, seed=3) for name in ("a", "b")]
    first, second = (with_cameras_beside(load_scene(path)) for path in paths)
    assert [texture.pixel_hash for texture in first.textures] == [texture.pixel_hash for texture in second.textures]
    assert len(first.materials) == len(first.textures) == 8
    assert sum(len(texture.maps) > 1 for texture in first.textures) == 2
    assert not first.report.missing
    assert [camera.name for camera in first.cameras] == ["street", "above"]
    assert np.isfinite(first.bounds).all()


def test_a_row_without_a_whole_picture_has_a_gap() -> None:
    figures = {"open_s": 1.0, "first_picture_s": 2.0, "whole_picture_s": None, "cpu_s": 3.0, "peak_mb": 2048.0}
    row = {"images": 10000, "case": "again", "camera": "street", "load_average": 2.2, **figures}
    assert table([row]).splitlines()[-1] == "| 10,000 | again | street | 1.0 s | 2.0 s |  | 3.0 s | 2.00 GiB | 2 |"
