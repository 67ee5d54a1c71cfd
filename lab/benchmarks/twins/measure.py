"""Make every twin of plain scenes, draw each beside its plain scene, and write a table, figures and a sheet of pictures.

    python -m lab.benchmarks.twins.measure assets/courtyard.glb --out docs/reports/twins.md \\
        --sheet docs/reports/figures/twins.webp --json FILE

Each twin is read from a file as a user would open it. `outside` counts pixels that show what the plain picture shows nowhere within
the distance and the values that the twin's quantisation allows (lab/benchmarks/twins/comparison.py): the bound is computed. Twins with
other images are compared to PNGs of what another decoder makes of those, too.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.measuring import chosen_cameras
from lab.benchmarks.twins.comparison import draw_base, fine_size, outside, picture_bound
from lab.benchmarks.twins.geometry import Twin, draco, filtered, lossless_meshopt, quantised
from lab.benchmarks.twins.pictures import archive, basis, bc7, own_ktx2, plain_ktx2, webp
from lab.benchmarks.twins.plain_scene import PlainScene
from lab.benchmarks.twins.sheet import write_sheet
from ntc.errors import InputError
from ntc.io import write_text
from viewer.cli.table import Column, Table
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.scene.load import load_scene

SIZE = (640, 360)
SHEET_WIDTH, SHEET_COLUMNS = 240, 4
TWINS: dict[str, Callable[[PlainScene], Twin]] = {
    "plain, as GLB": lambda scene: Twin(scene.glb()),
    "zip archive": archive,
    "EXT_meshopt_compression": lossless_meshopt("EXT_meshopt_compression", 0),
    "KHR_meshopt_compression": lossless_meshopt("KHR_meshopt_compression", 1),
    "meshopt, filters": filtered,
    "KHR_mesh_quantization": quantised,
    "KHR_draco_mesh_compression": draco,
    "KTX2, RGBA": plain_ktx2(0),
    "KTX2, RGBA, Zstandard": plain_ktx2(2),
    "KTX2, RGBA, zlib": plain_ktx2(3),
    "KTX2, BC7, Zstandard": bc7,
    "KHR_texture_basisu, UASTC": basis("uastc"),
    "KHR_texture_basisu, ETC1S": basis("etc1s"),
    "KHR_texture_basisu, its own": own_ktx2,
    "EXT_texture_webp, lossless": webp(lossless=True),
    "EXT_texture_webp, lossy": webp(lossless=False),
}
NOTE = """Made by `python -m lab.benchmarks.twins.measure`. Each twin is the plain scene compressed in one way, written to a file and
opened like any other. What it may differ by is computed from its quantisation, not measured: how far a point may move in the picture
(half a step of its positions, times the largest scale, at the distance of the nearest vertex in sight), and by how much a value may
differ (the largest error of a texel, since filtering is a mean in linear light and does not grow it; a shift in UV times the largest
step between neighbouring texels; 1 for rounding). A pixel is outside the bound where it shows what the plain scene, drawn in the same
size and in three times that, shows nowhere within that distance and those values. Twins with other images are compared to a scene with
PNGs of what another decoder (alktx2, Pillow) makes of the same files, too: those pictures must be equal.
Draco: 14 bits for positions, 12 for UVs, 10 for normals; filters: exponents of 16 bits, octahedra of 8; quantised: 16 bits.
"""
COLUMNS = (
    Column("scene", "scene"),
    Column("twin", "twin"),
    Column("megabytes", "MB", 2),
    Column("moved", "may move, pixels", 3),
    Column("values", "may differ by, of 255"),
    Column("differing", "pixels that differ, %", 2),
    Column("largest", "largest difference"),
    Column("outside", "outside the bound"),
    Column("other", "largest difference to another decoder's PNGs"),
)


def compare_twins(
    context: GraphicsContext, path: Path, camera: str | None, names: tuple[str, ...], size: tuple[int, int] = SIZE
) -> tuple[list[dict[str, Any]], list[tuple[str, NDArray[np.uint8]]]]:
    """(a row for each twin of the scene at `path`, titles and pictures). Raises InputError for scenes that are not plain."""
    whole = PlainScene.read(path)
    plain = load_scene(path)
    view = chosen_cameras(plain, None, [camera] if camera else None)[0]
    expected, fine = (draw_base(context, plain, view, drawn) for drawn in (size, fine_size(size)))
    rows: list[dict[str, Any]] = []
    pictures = [(f"{path.stem}: plain", expected)]
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            try:
                twin = TWINS[name](whole)
            except InputError as error:
                rows.append({"scene": path.stem, "twin": name, "refused": str(error)})
                continue
            place = Path(folder) / f"twin{twin.suffix}"
            place.write_bytes(twin.content)
            scene = load_scene(place)
            if scene.report.missing and not plain.report.missing:
                raise InputError(f"{path}, {name}: {scene.report.missing[0]}")
            found = draw_base(context, scene, view, size)
            bound = picture_bound(plain, view, size, twin.error)
            differing = (found != expected).any(axis=2)
            row: dict[str, Any] = {"scene": path.stem, "twin": name, "megabytes": len(twin.content) / 1e6}
            row |= {"moved": bound.pixels, "values": bound.values, "differing": 100.0 * float(differing.mean())}
            row["largest"] = int(np.abs(found.astype(int) - expected).max())
            row["outside"] = int(outside(expected, fine, found, bound).sum())
            if twin.decoded is not None:
                place.write_bytes(twin.decoded)
                decoded = draw_base(context, load_scene(place), view, size)
                row["other"] = int(np.abs(found.astype(int) - decoded).max())
            rows.append(row)
            pictures.append((name, found))
    return rows, pictures


def main() -> None:
    """Run and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--camera", help="name of a camera that all scenes have; the first one")
    parser.add_argument("--out", type=Path, help="write the table to this Markdown file")
    parser.add_argument("--sheet", type=Path, help="write the pictures to this WebP")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    context = create_headless_context()
    rows: list[dict[str, Any]] = []
    pictures: list[tuple[str, NDArray[np.uint8]]] = []
    for path in options.scenes:
        found, shown = compare_twins(context, path, options.camera, tuple(TWINS))
        rows += found
        pictures += shown
        for row in found:
            print(row, flush=True)
    made = [row for row in rows if "refused" not in row]
    table = Table(COLUMNS, made).markdown()
    size = "{}x{}".format(*SIZE)
    broken = [row for row in made if row["outside"] > 0]
    summary = (
        f"{len(made)} twins of {len(options.scenes)} scenes, base colours of the original images at {size}"
        f" ({context.info.renderer}): {len(broken)} with pixels outside the bound."
    )
    if options.out is not None:
        picture = f"\n![the twins]({options.sheet.name})\n" if options.sheet else ""
        write_text(options.out, f"# Twins\n\n{summary}\n\n{NOTE}\n{table}{picture}")
    if options.sheet is not None:
        write_sheet(options.sheet, pictures, SHEET_WIDTH, SHEET_COLUMNS)
    if options.json is not None:
        write_text(options.json, json.dumps({"summary": summary, "size": SIZE, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
