"""Opens and draws scenes of very many triangles, each in a process of its own, and writes figures, a table and a plot.

    python -m lab.benchmarks.geometry --folder /tmp/scenes --json lab/benchmarks/results/geometry_llvmpipe.json \
        --table docs/reports/geometry.md --plot docs/reports/figures/geometry.png

Scenes are made in FOLDER (up to 1.1 GiB for 50 million triangles) where they are not there yet, and stay there.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lab.benchmarks.geometry.scenes import write_geometry
from ntc.io import atomic_path, write_text

MILLIONS = (1, 10, 50)
KINDS = {"plain": False, "instanced": True}
SCENE_COLUMNS = {
    "scene": "scene",
    "file, MiB": "file_mib",
    "opened, s": "open_seconds",
    "first picture, s": "first_picture_seconds",
    "peak while opening, MiB": "open_peak_mib",
    "peak to the first picture, MiB": "first_picture_peak_mib",
    "arrays, bytes a triangle": "arrays_bytes_a_triangle",
    "on the GPU, bytes a triangle": "gpu_bytes_a_triangle",
}
FRAME_COLUMNS = {
    "scene": "scene",
    "camera": "camera",
    "culled by": "culled_by",
    "frame, ms": "frame_ms",
    "cull, ms": "cull_ms",
    "visibility, ms": "visibility_ms",
    "triangles drawn": "triangles",
    "commands": "commands",
}


def _cell(value: Any) -> str:
    return f"{value:.1f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)


def _table(columns: dict[str, str], rows: Sequence[dict[str, Any]]) -> list[str]:
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return lines + ["| " + " | ".join(_cell(row[key]) for key in columns.values()) + " |" for row in rows]


def tables(records: Sequence[dict[str, Any]]) -> str:
    """The document of all `records`."""
    first = records[0]
    frames = [{"scene": record["scene"]} | row for record in records for row in record["rows"]]
    lines = [
        "# Scenes of very many triangles",
        "",
        "Made by `python -m lab.benchmarks.geometry`: closed bodies of 25,088 triangles with normals and UVs, each stored by itself"
        " (`plain`) or eight of them at many nodes (`instanced`); one in eleven is mirrored.",
        f"{first['renderer']}, {first['size'][0]}x{first['size'][1]}, base colours; medians of {first['frames']} frames.",
        "",
        "![Seconds, memory and frame times](figures/geometry.png)",
        "",
        *_table(SCENE_COLUMNS, records),
        "",
        "Memory is that of the whole process, some 95 MiB before it opens anything; on this renderer the GPU's buffers are in"
        " it.",
        "",
        *_table(FRAME_COLUMNS, frames),
        "",
        "`gpu`: clusters of 128 triangles in compute shaders; `cpu`: clusters of 512 in numpy; `none`: everything is drawn.",
        "Scenes below 2 million triangles are culled on the CPU in the rows of `gpu`, too.",
        "",
        "The means were measured one after the other on two cores beside other work, whose load changed: times of one scene vary by"
        " up to three times and do not tell the means apart; memory, counts of triangles and commands do not depend on it.",
        "Drawn in turns, 10 million triangles take the same time by `gpu` and `cpu` on this software renderer. So culling on the GPU"
        " was not shown to pay there: software renderers cull on the CPU. On a GPU it has not been measured.",
    ]
    return "\n".join(lines) + "\n"


def plot(records: Sequence[dict[str, Any]], file: Path) -> None:
    """Seconds, memory and time of the visibility pass over the number of triangles."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.6), layout="constrained")
    axes = figure.subplots(1, 3)
    for kind in KINDS:
        own = [record for record in records if record["scene"].endswith(kind)]
        millions = [record["triangles_drawn"] / 1e6 for record in own]
        axes[0].plot(
            millions, [record["first_picture_seconds"] for record in own], "o-", label=f"first picture, {kind}"
        )
        axes[0].plot(millions, [record["open_seconds"] for record in own], "s--", label=f"opened, {kind}")
        axes[1].plot(millions, [record["first_picture_peak_mib"] for record in own], "o-", label=f"peak, {kind}")
    for means in ("gpu", "cpu", "none"):
        for camera, style in (("overview", "o-"), ("street", "s--")):
            own = [record for record in records if record["scene"].endswith("plain")]
            times = [
                row["cull_ms"] + row["visibility_ms"]
                for record in own
                for row in record["rows"]
                if (row["culled_by"], row["camera"]) == (means, camera)
            ]
            axes[2].plot([r["triangles_drawn"] / 1e6 for r in own], times, style, label=f"{camera}, {means}")
    for axis, title in zip(axes, ("seconds", "MiB", "culling and visibility, ms"), strict=True):
        axis.set(xlabel="million triangles", title=title, xscale="log", yscale="log")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    with atomic_path(file) as partial:
        figure.savefig(partial, dpi=110)


def _measured(scene: Path, frames: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "record.json"
        command = [sys.executable, "-m", "lab.benchmarks.geometry.measure", str(scene), str(out)]
        subprocess.run([*command, "--frames", str(frames)], check=True)
        record: dict[str, Any] = json.loads(out.read_text())
        return record


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", type=Path, required=True, help="where the scenes lie or are made")
    parser.add_argument("--millions", type=int, nargs="+", default=MILLIONS)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--again", action="store_true", help="measure nothing, write table and plot of the JSON anew")
    given = parser.parse_args()
    records: list[dict[str, Any]] = json.loads(given.json.read_text())["scenes"] if given.again else []
    for millions in () if given.again else given.millions:
        for kind, instanced in KINDS.items():
            scene = given.folder / f"{millions}m-{kind}.glb"
            if not scene.is_file():
                write_geometry(scene, millions * 1_000_000, instanced=instanced)
            records.append(_measured(scene, given.frames))
            write_text(given.json, json.dumps({"scenes": records}, indent=1) + "\n")
    if given.table is not None:
        write_text(given.table, tables(records))
    if given.plot is not None:
        plot(records, given.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
