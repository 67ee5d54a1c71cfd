"""What the benchmarks share: arguments, cameras, frame times, tables."""

import argparse
import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ntc.io import write_text
from viewer.scene.cameras_file import read_cameras
from viewer.scene.model import Camera, Scene
from viewer.state.camera import frame_all

LOG_COLUMNS = 160
"""Width of a table that goes to a file."""


def size_of(text: str) -> tuple[int, int]:
    """(width, height) of "1280x720"."""
    width, _, height = text.partition("x")
    return int(width), int(height)


def arguments(description: str | None) -> argparse.ArgumentParser:
    """Options that every benchmark of a scene has."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--cameras", type=Path, help="cameras.json; without it the scene's own cameras")
    parser.add_argument("--camera", action="append", help="name of a camera; may be given again; default all")
    parser.add_argument("--size", type=size_of, default=(1280, 720), metavar="WxH")
    parser.add_argument("--frames", type=int, default=9, help="timed frames for each camera")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    return parser


def chosen_cameras(scene: Scene, file: Path | None, names: Sequence[str] | None) -> tuple[Camera, ...]:
    """The cameras to measure. Raises InputError for a bad file."""
    cameras = read_cameras(file) if file is not None else scene.cameras or (frame_all(scene.bounds),)
    return tuple(camera for camera in cameras if not names or camera.name in names)


def median(values: Sequence[float]) -> float:
    """Median, 0 without values."""
    return statistics.median(values) if values else 0.0


def report(title: str, rows: Sequence[dict[str, Any]], facts: dict[str, Any], file: Path | None) -> None:
    """Print `rows` as a table and, where `file` is given, write them with `facts` as JSON."""
    table = Table(title=title)
    for name in rows[0] if rows else ():
        table.add_column(name, justify="left" if isinstance(rows[0][name], str) else "right")
    for row in rows:
        table.add_row(*(f"{value:.2f}" if isinstance(value, float) else str(value) for value in row.values()))
    console = Console()
    if not console.is_terminal:
        console = Console(width=LOG_COLUMNS)
    console.print(table)
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()))
    if file is not None:
        write_text(file, json.dumps({**facts, "rows": list(rows)}, indent=1) + "\n")
