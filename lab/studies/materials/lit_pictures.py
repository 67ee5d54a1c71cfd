"""Lit pictures of whole materials: codec `block` beside ASTC and BC7 with BC5, at the same stored bits of all maps.

python -m lab.studies.materials.lit_pictures SCENE ... --json lab/benchmarks/results/studies/lit_pictures.json
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lab.studies.materials.own_codec import LARGEST_BITS, grouped_by_maps
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.mips import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.errors import InputError
from ntc.io import write_text
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.image_quality import flip
from ntc.training.encode import encode_textures
from viewer.cli.sources import compress_scene
from viewer.cli.table import Column, Table
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.scene.source_textures import source_textures
from viewer.state.framing import frame_all
from viewer.state.view_state import Slot, ViewState

FORMATS: tuple[BlockFormat, ...] = ("astc-10x10", "astc-8x8", "astc-6x6", "bc7")
ORBIT = ((40.0, 15.0), (130.0, 25.0), (220.0, 10.0), (310.0, 35.0))
"""Azimuth and elevation in degrees of views of a scene without cameras."""
COLUMNS = (
    Column("scene", "scene"),
    Column("format", "beside"),
    Column("bits_per_texel", "bits/texel, all maps"),
    Column("hardware_db", "its PSNR, dB"),
    Column("block_db", "codec block, dB"),
    Column("more_db", "more, dB"),
    Column("hardware_flip", "its FLIP", 4),
    Column("block_flip", "FLIP of codec block", 4),
)
NEARER = 0.55
"""Distance of those views, of that from which all of the scene is seen."""


def cameras_of(scene: Scene, most: int) -> tuple[Camera, ...]:
    """The scene's own, else views around it."""
    if scene.cameras:
        return scene.cameras[:most]
    whole = frame_all(scene)
    target = np.array(whole.target)
    distance = NEARER * float(np.linalg.norm(np.array(whole.eye) - target))
    found = []
    for number, (azimuth, elevation) in enumerate(np.radians(ORBIT[:most])):
        direction = np.array(
            [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
        )
        x, y, z = (target + distance * direction).tolist()
        found.append(Camera(f"around {number + 1}", (x, y, z), whole.target))
    return tuple(found)


def pack_of_bits(scene: Scene, bits: float) -> Pack:
    """All maps in codec `block`, sets of one kind with one decoder, in `bits` a texel."""
    textures = source_textures(scene, None, "all")
    grouping = grouped_by_maps(textures)
    config = config_for_bits(min(bits, LARGEST_BITS), texture_set(textures, grouping.group_count))
    return encode_textures(textures, grouping, config, BlockOptions())


def compare(context: GraphicsContext, scene: Scene, size: tuple[int, int], most: int) -> list[dict[str, Any]]:
    """A row for each format and camera: PSNR (dB) and FLIP of the lit picture against that of the original images."""
    rows = []
    for block_format in FORMATS:
        compressed = compress_scene(scene, block_format)
        pack = pack_of_bits(scene, compressed.bits_per_texel)
        renderer = Renderer(context, scene)
        renderer.images.set_compressed({block_format: compressed})
        renderer.set_packs({"block": pack})
        for camera in cameras_of(scene, most):
            renderer.render(ViewState(camera, size, material_view="lit"), whole=True)
            truth, covered = linear_to_srgb8(renderer.picture(Slot())), renderer.covered()
            row: dict[str, Any] = {"scene": scene.name, "format": block_format, "camera": camera.name}
            row["bits_per_texel"] = compressed.bits_per_texel
            for name, slot in (("hardware", Slot(block_format)), ("block", Slot("block", "cached"))):
                shown = linear_to_srgb8(renderer.picture(slot))
                row[f"{name}_db"] = psnr_db(shown[covered], truth[covered])
                row[f"{name}_flip"] = flip(truth, shown)
            row["more_db"] = row["block_db"] - row["hardware_db"]
            rows.append(row)
            sys.stdout.write(json.dumps(row) + "\n")
            sys.stdout.flush()
        renderer.release()
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, print, and write the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 400))
    parser.add_argument("--most", type=int, default=4, help="cameras of each scene")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    context, rows = create_headless_context(), list[dict[str, Any]]()
    try:
        for path in options.scenes:
            rows += compare(context, load_scene(path), tuple(options.size), options.most)
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    means = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        for block_format in FORMATS:
            own = [row for row in rows if (row["scene"], row["format"]) == (scene, block_format)]
            keys = ("bits_per_texel", "hardware_db", "block_db", "more_db", "hardware_flip", "block_flip")
            means.append(
                {"scene": scene, "format": block_format, **{key: float(np.mean([r[key] for r in own])) for key in keys}}
            )
    table = Table(COLUMNS, means).markdown()
    sys.stdout.write(table)
    if options.json:
        record = {"size": list(options.size), "rows": means, "views": rows}
        write_text(options.json, json.dumps(record, indent=1) + "\n")
        write_text(options.json.with_suffix(".md"), f"# Lit pictures, means over cameras\n\n{table}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
