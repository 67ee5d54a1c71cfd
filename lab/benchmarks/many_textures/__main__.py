"""Seconds and memory that scenes of 100, 1,000 and 10,000 textures take to open and to draw.

    python -m lab.benchmarks.many_textures FOLDER --json F.json --plot F.png [--textures 100 1000 10000]

FOLDER takes the scenes (2.6 GB for 10,000 textures), which are made where they are not there yet.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from lab.benchmarks.many_textures.generate import write_scene
from ntc.io import atomic_path, write_text
from viewer.locations import CACHE_FOLDER_VARIABLE

CAMERAS = ("street", "above")


def _run(cache: Path, *arguments: str) -> str:
    command = [sys.executable, "-m", "lab.benchmarks.many_textures.open_scene", *arguments]
    environment = {**os.environ, CACHE_FOLDER_VARIABLE: str(cache)}
    return subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout


def measure(scene: Path, whole: bool) -> list[dict[str, Any]]:
    """The first time, when nothing is known of the images; then again, from each camera; then with a pack."""
    rows: list[dict[str, Any]] = []

    def note(case: str, camera: str, *more: str) -> None:
        first = () if whole else ("--first",)
        found = json.loads(_run(cache, str(scene), "--camera", camera, *more, *first))
        rows.append({"case": case, "camera": camera, "load_average": os.getloadavg()[0], **found})
        print(rows[-1], flush=True)

    with tempfile.TemporaryDirectory() as name:
        cache, pack = Path(name, "cache"), Path(name, "pack.ntc")
        note("first time", CAMERAS[0])
        for camera in CAMERAS:
            note("again", camera)
        _run(cache, str(scene), "--make-pack", str(pack))
        note("with a pack", CAMERAS[0], "--pack", str(pack))
        shutil.rmtree(cache, ignore_errors=True)
    return rows


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.1f} s"


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown."""
    titles = ("images", "case", "camera", "open", "first picture", "whole picture", "CPU", "memory", "load")
    lines = [
        (
            f"{row['images']:,}",
            row["case"],
            row["camera"],
            _seconds(row["open_s"]),
            _seconds(row["first_picture_s"]),
            _seconds(row["whole_picture_s"]),
            _seconds(row["cpu_s"]),
            f"{row['peak_mb'] / 1024:.2f} GiB",
            f"{row['load_average']:.0f}",
        )
        for row in rows
    ]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (titles, ("--:", "---", *["--:"] * 7), *lines))


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Seconds to a first picture, and memory, by the number of images."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    cases = dict.fromkeys((row["case"], row["camera"]) for row in rows)
    for case, camera in cases:
        own = [row for row in rows if (row["case"], row["camera"]) == (case, camera)]
        images = [row["images"] for row in own]
        left.loglog(images, [row["first_picture_s"] for row in own], "o-", label=f"{case}, {camera}")
        right.semilogx(images, [row["peak_mb"] / 1024 for row in own], "o-")
    left.axhline(60.0, color="grey", linestyle=":")
    right.axhline(4.0, color="grey", linestyle=":")
    left.set(xlabel="images", ylabel="first picture, s")
    right.set(xlabel="images", ylabel="largest memory, GiB", ylim=(0.0, None))
    left.legend(fontsize="small")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)


def main() -> None:
    """Measure scenes of several sizes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--textures", type=int, nargs="+", default=[100, 1000, 10000])
    parser.add_argument(
        "--whole-up-to", type=int, default=1000, help="images up to which the whole picture is waited for"
    )
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for count in options.textures:
        folder = options.folder / str(count)
        scene = folder / "scene.gltf"
        if not scene.is_file():
            write_scene(folder, count)
        rows += [{"images": count, **row} for row in measure(scene, count <= options.whole_up_to)]
        write_text(options.json, json.dumps({"processors": os.cpu_count(), "rows": rows}, indent=1) + "\n")
    if options.plot is not None:
        plot(rows, options.plot)
    print(table(rows))


if __name__ == "__main__":
    main()
