"""Read and draw every scene below a folder, each in a process of its own with a time limit, and write a table.

    python -m lab.benchmarks.conformance DIR --out docs/reports/conformance.md --sheet docs/reports/figures/conformance.webp --json \
        lab/benchmarks/results/conformance_llvmpipe.json

A scene that is refused with one line is no failure; one that ends a process in any other way is.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.sheet import write_sheet
from lab.runner import options, run, write_record
from ntc.io import write_text
from viewer.cli.info import KINDS, files_below
from viewer.cli.table import Column, Table
from viewer.scene.images import read_image
from viewer.scene.report import KINDS as LISTS
from viewer.scene.scene_files import CAMERAS_FILE

SIZE = "320x180"
SHEET_WIDTH, SHEET_COLUMNS = 240, 5
BAD_INPUT = 2
COLUMNS = (
    Column("file", "file"),
    Column("result", "result"),
    Column("render", "render"),
    Column("triangles", "triangles"),
    Column("textures", "textures"),
    Column("seconds", "load and draw, s", 1),
    *(Column(kind, kind) for kind in LISTS),
)


def _command(arguments: list[str], limit: float) -> tuple[int | None, str, str]:
    """(exit status or None when time was over, stdout, last line of stderr)."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "viewer", *arguments],
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
            errors="replace",
        )
    except subprocess.TimeoutExpired:
        return None, "", f"longer than {limit:g} s"
    lines = done.stderr.strip().splitlines()
    return done.returncode, done.stdout, lines[-1] if lines else ""


def _outcome(status: int | None, line: str, done: str, path: Path) -> str:
    if status == 0:
        return done
    if status == BAD_INPUT:
        return "refused: " + line.removeprefix("error: ").removeprefix(f"{path}: ")
    return f"failed: {line}" if status is None else f"crashed (exit {status}): {line}"


def examine(path: Path, folder: Path, limit: float) -> tuple[dict[str, Any], NDArray[np.uint8] | None]:
    """(what happened when the scene at `path` was read and drawn on the reference path, its picture lit by the sky)."""
    picture = None
    row: dict[str, Any] = {"file": path.relative_to(folder).as_posix(), "render": "-"}
    status, text, line = _command(["info", str(path), "--json"], limit)
    row["result"] = _outcome(status, line, "read", path)
    if status != 0:
        return row, None
    information = json.loads(text)
    row |= {key: information["used"][key] for key in ("triangles", "textures")}
    row |= {key: "; ".join(information[key]) or None for key in LISTS}
    with tempfile.TemporaryDirectory() as out:
        started = time.monotonic()
        arguments = ["render", str(path), "--grouping", "reference", "--view", "lit", "--size", SIZE, "--out", out]
        cameras = path.parent / CAMERAS_FILE
        if cameras.is_file():
            arguments += ["--cameras", str(cameras)]
        status, _, line = _command(arguments, limit)
        row["seconds"] = time.monotonic() - started
        row["render"] = _outcome(status, line, "ok", path)
        if status == 0:
            stats = json.loads((Path(out) / "stats.json").read_text())
            row["renderer"] = stats["renderer"]
            row["covered"] = stats["pixels"]["covered"]
            if row["covered"] == 0:
                row["render"] = "ok, the first camera sees nothing"
            picture = read_image(Path(out) / "color.png")[..., :3]
    return row, picture


def main() -> None:
    """Run and report."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, help="write the table to this Markdown file")
    parser.add_argument("--sheet", type=Path, help="write the pictures to this WebP")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for each process")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    pictures: list[tuple[str, NDArray[np.uint8]]] = []
    for path in files_below(given.folder):
        if KINDS[path.suffix.lower()] == "pack":
            continue
        row, picture = examine(path, given.folder, given.limit)
        rows.append(row)
        if picture is not None:
            pictures.append((row["file"], picture))
        print(rows[-1]["file"], rows[-1]["result"], rows[-1]["render"], flush=True)
    table = Table(COLUMNS, rows)
    read = sum(row["result"] == "read" for row in rows)
    refused = sum(row["result"].startswith("refused") for row in rows)
    drawn = sum(row["render"].startswith("ok") for row in rows)
    renderer = next((row["renderer"] for row in rows if "renderer" in row), "-")
    summary = (
        f"{len(rows)} scenes: {read} read, {refused} refused with one line, {len(rows) - read - refused} crashed;"
        f" {drawn} of {read} drawn at {SIZE} on the reference path ({renderer})."
    )
    text = (
        f"# Conformance\n\n{summary}\nMade by `python -m lab.benchmarks.conformance DIR --out F.md`. Time is that of one"
        " `ntc-viewer render`, start of the program included.\nWhat the columns honoured and ignored mean: gltf.md."
        " Compressed twins of plain scenes: twins.md.\n\n"
    )
    if given.sheet is not None:
        write_sheet(given.sheet, pictures, SHEET_WIDTH, SHEET_COLUMNS)
        text += f"![the scenes, lit by the sky]({given.sheet.name})\n\n"
    if given.out is not None:
        write_text(given.out, text + table.markdown())
    else:
        print(table.markdown())
    write_record(given.json, {"summary": summary, "rows": rows})


if __name__ == "__main__":
    run(main)
