"""Codec `block` on folders of map files, as ambientCG and Poly Haven name them: each material alone, whole, at its own size.

python -m lab.benchmarks.material_sets FOLDER --bits 4.25 --json F.json
"""

import json
import re
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.runner import options, run, write_record
from lab.studies.set_quality import pack_bits_per_texel
from ntc import material
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.maps import MAP_CHANNELS, MAP_WEIGHTS, MapName
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.training.encode import encode_textures
from viewer.cli.table import Cell, Column, Table
from viewer.scene.images import IMAGE_SUFFIXES, read_image
from viewer.scene.source_textures import reduce_texture

WORDS: Mapping[str, Sequence[tuple[MapName, int]]] = {
    "color": [("base", 0)],
    "diff": [("base", 0)],
    "diffuse": [("base", 0)],
    "albedo": [("base", 0)],
    "normalgl": [("normal", 0)],
    "nor": [("normal", 0)],
    "roughness": [("roughness", 0)],
    "rough": [("roughness", 0)],
    "metalness": [("metalness", 0)],
    "metal": [("metalness", 0)],
    "ambientocclusion": [("occlusion", 0)],
    "ao": [("occlusion", 0)],
    "emission": [("emissive", 0)],
    "arm": [("occlusion", 0), ("roughness", 1), ("metalness", 2)],
}
"""By the word in a file's name: its maps, and the channel that each begins with."""
IGNORED = re.compile(r"^(\d+k|jpg|png|gl|exr)$")
"""Parts of names that say nothing about the map: resolution, format, and that normals are as in OpenGL."""
COLUMNS = (
    Column("material", "material"),
    Column("texels", "texels a side"),
    Column("bits_per_texel", "bits/texel"),
    Column("mean_of_maps_db", "mean of maps, dB"),
    Column("normal_db", "normal, dB"),
    Column("degrees", "angle of normals, degrees"),
    Column("seconds", "processor s", 1),
)


def named_maps(path: Path) -> tuple[str, Sequence[tuple[MapName, int]]] | None:
    """(material, maps with their first channels) by the name of a map's file; None for a file that is none of these."""
    parts = [part for part in re.split(r"[_\-. ]", path.stem) if not IGNORED.match(part.lower())]
    for place in range(len(parts) - 1, 0, -1):
        if parts[place].lower() in WORDS:
            return "_".join(parts[:place]), WORDS[parts[place].lower()]
    return None


def material_sets(folder: Path, size: int | None) -> list[SourceTexture]:
    """The materials whose map files lie in `folder` and below, by name. Raises InputError for a folder without any, and for maps of
    several sizes."""
    found = dict[str, dict[MapName, NDArray[np.uint8]]]()
    for path in sorted(each for each in folder.rglob("*") if each.suffix.lower() in IMAGE_SUFFIXES):
        named = named_maps(path)
        if named is None:
            continue
        pixels = read_image(path)
        for name, first in named[1]:
            channels = pixels[..., first : first + MAP_CHANNELS[name]]
            found.setdefault(named[0], {}).setdefault(name, np.ascontiguousarray(channels))
    sets = [material(maps, name) for name, maps in found.items() if len(maps) > 1]
    if not sets:
        raise InputError(f"{folder}: holds no materials with several maps, such as Rails001_4K-JPG_Color.jpg")
    return sets if size is None else [reduce_texture(each, size) for each in sets]


def measured(source: SourceTexture, bits: float, weights: str) -> dict[str, Any]:
    """Quality of each map of a material that is encoded alone, tables included in its bits."""
    source = SourceTexture(**{**vars(source), "map_weights": MAP_WEIGHTS[weights]})  # type: ignore[index]
    began = time.process_time()
    pack = encode_textures(
        [source], Grouping("single", (0,)), config_for_bits(bits, texture_set([source], 1)), BlockOptions()
    )
    (texture,) = pack.textures
    by_map = dict(zip(source.maps, texture.map_psnr_db or (), strict=True))
    return {
        "material": source.name,
        "texels": source.pixels.shape[0],
        "pixels_hash": hash_pixels(source.pixels),
        "bits_per_texel": pack_bits_per_texel(pack),
        "map_db": by_map,
        "mean_of_maps_db": float(np.mean(list(by_map.values()))),
        "normal_db": by_map.get("normal"),
        "degrees": texture.normal_degrees[0] if texture.normal_degrees else None,
        "seconds": time.process_time() - began,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print a table, and write the record. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bits", type=float, default=4.25, help="bits per texel of mip 0 of all maps, mips and tables")
    parser.add_argument("--texture-size", type=int, help="at most so many texels a side; default: as the files are")
    parser.add_argument("--weights", choices=sorted(MAP_WEIGHTS), default="equal", help="of errors in the maps")
    given = parser.parse_args(arguments)
    rows = list[dict[str, Any]]()
    for source in material_sets(given.folder, given.texture_size):
        rows.append(measured(source, given.bits, given.weights))
        sys.stderr.write(f"{source.name}: {rows[-1]['mean_of_maps_db']:.2f} dB\n")
    every = [value for row in rows for value in row["map_db"].values()]
    kinds = dict[str, list[float]]()
    for row in rows:
        for name, value in row["map_db"].items():
            kinds.setdefault(name, []).append(value)
    by_kind = {name: float(np.mean(values)) for name, values in kinds.items()}
    shown: list[Mapping[str, Cell]] = [{key.key: row[key.key] for key in COLUMNS} for row in rows]
    sys.stdout.write(Table(COLUMNS, shown).markdown())
    sys.stdout.write(f"mean of {len(every)} maps: {np.mean(every):.2f} dB; of kinds of maps: ")
    sys.stdout.write(f"{np.mean(list(by_kind.values())):.2f} dB ({json.dumps(by_kind)})\n")
    facts = {"weights": given.weights, "mean_of_maps_db": float(np.mean(every)), "by_kind_db": by_kind}
    write_record(given.json, {**facts, "rows": rows})


if __name__ == "__main__":
    run(main)
