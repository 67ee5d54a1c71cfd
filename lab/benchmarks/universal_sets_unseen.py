"""Grouping `universal` on whole materials that its tables never saw, beside tables fitted to them (`clustered`), at equal bits.

python -m lab.benchmarks.universal_sets_unseen unseen NAME SIZE [SIZE ...] --fit PLACE ... --test PLACE ... --json FILE

Tables are fitted to the materials of --fit: scenes, or folders with a folder for each material (assets/README.md). Every material of
--test becomes a scene of its own, and all of them together another one, at each SIZE. A FILE that is there keeps its other rows.
"""

import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from safetensors.numpy import save

from assets.build.universal_sets import drawn_samples, fitted_set_tables, read_materials
from lab.runner import options, run, write_record
from ntc.codec.block import universal
from ntc.codec.config import UNIVERSAL, GroupingConfig, GroupingName
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.grouping import make_grouping
from ntc.io import write_bytes
from ntc.pack.file import pack_bytes
from ntc.training.encode import encode_chosen
from viewer.scene.source_textures import reduce_texture

BITS = (2.0, 4.0)
KEYS = ("materials_of", "a_pack_each", "size", "bits_per_texel")
"""What tells the rows of a record apart."""
GROUPINGS: tuple[GroupingName, ...] = ("clustered", UNIVERSAL)


@contextmanager
def other_tables(path: Path) -> Iterator[None]:
    """Within it, the tables at `path` are those that ship."""
    universal.set_tables.cache_clear()
    with patch.object(universal, "set_tables_path", lambda _: path):
        yield
    universal.set_tables.cache_clear()


def measured(textures: Sequence[SourceTexture], bits: float, name: GroupingName) -> dict[str, Any]:
    """Quality and size of a pack of `textures` at `bits` a texel."""
    grouping = make_grouping(GroupingConfig(name), textures)
    pack = encode_chosen(textures, grouping, codec_named("block"), EncodingChoices(target=BitsTarget(bits)))
    maps: dict[str, list[float]] = {}
    for texture in pack.textures:
        for own, decibels in zip(texture.maps, texture.map_psnr_db, strict=True):
            if decibels is not None:
                maps.setdefault(own, []).append(decibels)
    angles = [texture.normal_degrees[0] for texture in pack.textures if texture.normal_degrees]
    return {
        "mean_db": round(float(np.mean([texture.psnr_db or 0.0 for texture in pack.textures])), 2),
        "maps_db": {own: round(float(np.mean(values)), 2) for own, values in maps.items()},
        "normal_degrees": round(float(np.mean(angles)), 2) if angles else None,
        "file_bytes": len(pack_bytes(pack)),
        "groups": len(pack.decoders),
    }


def _rows(
    name: str, materials: Sequence[SourceTexture], size: int, fitted: int, together: bool
) -> Iterator[dict[str, Any]]:
    """A row for each rate of materials one by one, of which the means are kept, or of all together."""
    small = [reduce_texture(replace(each, category=None), size) for each in materials]
    scenes = [small] if together else [[each] for each in small]
    for bits in BITS:
        found = [{grouping: measured(scene, bits, grouping) for grouping in GROUPINGS} for scene in scenes]
        gains = [each[UNIVERSAL]["mean_db"] - each["clustered"]["mean_db"] for each in found]
        row: dict[str, Any] = {
            "materials_of": name,
            "materials": len(small),
            "a_pack_each": not together,
            "size": size,
            "bits_per_texel": bits,
            "fitted_to": fitted,
        }
        for grouping in GROUPINGS:
            own = [each[grouping] for each in found]
            row[grouping] = {
                "mean_db": round(float(np.mean([each["mean_db"] for each in own])), 2),
                "maps_db": {
                    n: round(float(np.mean([each["maps_db"][n] for each in own if n in each["maps_db"]])), 2)
                    for n in dict.fromkeys(n for each in own for n in each["maps_db"])
                },
                "normal_degrees": _mean([each["normal_degrees"] for each in own]),
                "file_bytes": sum(each["file_bytes"] for each in own),
            }
        row |= {"gain_db": round(float(np.mean(gains)), 2), "least_gain_db": round(min(gains), 2)}
        print(json.dumps(row), flush=True)
        yield row


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(float(np.mean(known)), 2) if known else None


def main() -> None:
    """Measure and print. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("name", help="of the materials that are measured")
    parser.add_argument("sizes", type=int, nargs="+")
    parser.add_argument(
        "--fit", type=Path, nargs="*", default=[], help="materials to fit to; none: the tables that ship"
    )
    parser.add_argument("--test", type=Path, nargs="+", required=True, help="materials to measure")
    parser.add_argument("--most", type=int, help="measure so many materials, evenly spread")
    parser.add_argument("--one-pack", action="store_true", help="all materials in one pack; else a pack each")
    parser.add_argument("--tables", type=Path, help="file that keeps the fitted tables")
    given = parser.parse_args()
    materials = read_materials(given.test)
    if given.most:
        places = np.unique(np.linspace(0, len(materials) - 1, given.most).round().astype(int))
        materials = tuple(materials[place] for place in places)
    with tempfile.TemporaryDirectory() as folder:
        path = given.tables or Path(folder) / "tables.safetensors"
        seen = read_materials(given.fit)
        if seen and not path.is_file():
            write_bytes(path, save(fitted_set_tables(drawn_samples(seen))))
        with other_tables(path if seen else universal.set_tables_path(universal.SET_VERSION)):
            rows = [
                row for size in given.sizes for row in _rows(given.name, materials, size, len(seen), given.one_pack)
            ]
    known = json.loads(given.json.read_text())["rows"] if given.json and given.json.is_file() else []
    fresh = {tuple(row[key] for key in KEYS) for row in rows}
    kept = [row for row in known if tuple(row[key] for key in KEYS) not in fresh]
    write_record(given.json, {"rows": kept + rows})


if __name__ == "__main__":
    run(main)
