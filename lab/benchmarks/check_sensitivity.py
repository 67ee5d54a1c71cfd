"""Whether `ntc-viewer check` finds small changes: one map 0.2 dB worse, and a pack 1 % larger; and how long it takes.

python -m lab.benchmarks.check_sensitivity SCENE.gltf SCENE.ntc --json FILE: the pack is of codec block, and holds whole materials or
base colours. Each changed pack is checked against the report of the pack as it is.
"""

import contextlib
import io
import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from lab.runner import options, run, write_record
from ntc.api import decode
from ntc.codec.block.model import BlockTexture
from ntc.codec.maps import MapName, map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.quality import measured_texture
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from viewer import cli
from viewer.checking.textures import original_of
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene

LOSS_DB = 0.2
CHANGES = 6
"""Maps that are changed, one at a time."""
STEPS = 30


@dataclass(frozen=True, eq=False)
class Change:
    """A pack in which one map of one texture is worse."""

    pack: Pack
    texture: str
    map: MapName
    loss_db: float


def map_quality(texture: EncodedTexture, name: MapName) -> float:
    """Return the PSNR in dB of a map of a measured texture."""
    found = texture.map_psnr_db[texture.maps.index(name)] if texture.map_psnr_db else texture.psnr_db
    if found is None:
        raise InputError(f"{texture.name}: map {name} is exact; it cannot be measured")
    return found


def worsened(scene: Scene, pack: Pack, index: int, name: MapName) -> Change:
    """Return `pack` with an offset on one map of texture `index` that costs about LOSS_DB: halved or doubled until it does."""
    texture = cast(BlockTexture, pack.textures[index])
    texture_id = match_scene(pack, scene).texture_index.index(index)
    pixels = original_of(scene, texture_id, texture).pixels
    before = map_quality(measured_texture(texture, decode(pack, index), pixels), name)
    low, high = 0.0, 0.2
    changed, loss = pack, 0.0
    for _ in range(STEPS):
        offset = (low + high) / 2.0
        mean = texture.mean.copy()
        mean[:, map_slices(texture.maps, texture.channels)[name]] += np.float32(offset)
        own = replace(texture, mean=mean)
        changed = replace(pack, textures=(*pack.textures[:index], own, *pack.textures[index + 1 :]))
        loss = before - map_quality(measured_texture(own, decode(changed, index), pixels), name)
        if abs(loss - LOSS_DB) < 0.01:
            break
        low, high = (offset, high) if loss < LOSS_DB else (low, offset)
    return Change(changed, texture.name, name, loss)


def run_check(scene: Path, pack: Path, *options: str) -> tuple[int, str, float]:
    """Return (exit status, what it prints, seconds) of a check of textures and two views."""
    out, began = io.StringIO(), time.perf_counter()
    with contextlib.redirect_stdout(out):
        status = cli.main(["check", str(scene), "--pack", str(pack), *options])
    return status, out.getvalue(), time.perf_counter() - began


def sensitivity(path: Path, pack_path: Path, folder: Path) -> dict[str, Any]:
    """Return the figures of one scene. Raises InputError."""
    scene, pack = load_scene(path), read_pack(pack_path)
    accepted = folder / "accepted"
    _, _, first = run_check(path, pack_path, "--out", str(accepted))
    against = ("--against", str(accepted / "report.json"))
    unchanged, _, again = run_check(path, pack_path, *against)
    random = np.random.default_rng(0)
    held = [index for index in match_scene(pack, scene).texture_index if index >= 0]
    rows = []
    for index in random.permutation(held)[:CHANGES]:
        texture = pack.textures[index]
        change = worsened(scene, pack, index, texture.maps[int(random.integers(len(texture.maps)))])
        write_pack(folder / "changed.ntc", change.pack)
        status, told, seconds = run_check(path, folder / "changed.ntc", *against, "--views", "0")
        named = [line for line in told.splitlines() if line.startswith(f"{change.texture}, map {change.map}: PSNR")]
        others = [line for line in told.splitlines()[:-1] if not line.startswith(f"{change.texture},")]
        rows.append(
            {
                "texture": change.texture,
                "map": change.map,
                "loss_db": round(change.loss_db, 3),
                "found_and_named": status == 1 and len(named) == 1,
                "wrong_findings": len(others),
                "seconds": round(seconds, 2),
            }
        )
    larger = replace(pack, training={**pack.training, "padding": "x" * int(pack_path.stat().st_size * 0.0102)})
    write_pack(folder / "larger.ntc", larger)
    status, told, _ = run_check(path, folder / "larger.ntc", *against, "--views", "0")
    return {
        "scene": path.name,
        "textures": len(held),
        "first_check_seconds": round(first, 2),
        "unchanged_seconds": round(again, 2),
        "unchanged_passes": unchanged == 0,
        "changes": rows,
        "one_per_cent_of_bytes_found": status == 1 and "size on disk" in told,
    }


def main() -> None:
    """Run the benchmark. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="SCENE PACK pairs")
    given = parser.parse_args()
    found = []
    for scene, pack in zip(given.files[::2], given.files[1::2], strict=True):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["NTC_VIEWER_CACHE_DIR"] = str(Path(folder, "cache"))
            found.append(sensitivity(scene, pack, Path(folder)))
        sys.stdout.write(json.dumps(found[-1], indent=1) + "\n")
    write_record(given.json, {"loss_db": LOSS_DB, "scenes": found})


if __name__ == "__main__":
    run(main)
