"""`python -m assets.build.universal FOLDER ... --materials PLACE ...`: fits the tables of grouping `universal`. Deterministic.

Tables for base colours are fitted to the images of the folders; those for whole materials to the materials of scenes, or of folders
with a folder for each material. Give what is CC0 or permissively licensed alone; assets/README.md names what the shipped tables were
fitted to.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from safetensors.numpy import save

from assets.build.universal_sets import drawn_samples, fitted_set_tables, read_materials
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.tables import fit_decoder
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.universal import (
    SET_VERSION,
    UNIVERSAL_CONFIG,
    VERSION,
    set_tables_path,
    tables_path,
    universal_tensors,
)
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.io import write_bytes
from viewer.scene.images import folder_textures
from viewer.scene.load import load_scene
from viewer.scene.source_textures import reduce_texture, source_textures

SIDE = 512
"""Textures are reduced to this many texels."""
BLOCKS_PER_TEXTURE = 3000
PERMISSIVE = ("CC0", "Apache-2.0")
"""How licences begin in a folder's manifest.csv whose images are taken."""
WITH_ALPHA = 3
"""One texture in so many gets an alpha channel in the tables with alpha."""


def permissive_textures(folders: Sequence[Path]) -> tuple[SourceTexture, ...]:
    """The images of folders, and the textures of scenes; of a folder with a manifest.csv (file, category, licence, source) those whose
    licence is permissive. Raises InputError."""
    textures: list[SourceTexture] = []
    for folder in folders:
        if folder.is_file():
            textures += source_textures(load_scene(folder), SIDE)
            continue
        found = [reduce_texture(texture, SIDE) for texture in folder_textures(folder)]
        manifest = folder / "manifest.csv"
        if manifest.is_file():
            with manifest.open(encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
            allowed = {str(Path(row["file"]).with_suffix("")) for row in rows if row["licence"].startswith(PERMISSIVE)}
            found = [texture for texture in found if texture.name in allowed]
        textures += found
    return tuple(textures)


def with_alpha(textures: Sequence[SourceTexture]) -> tuple[SourceTexture, ...]:
    """`textures`, with a mask as alpha channel in some of them: where another one is bright, with soft edges."""
    found: list[SourceTexture] = []
    for index, texture in enumerate(textures):
        colour = texture.pixels[..., :3]
        if index % WITH_ALPHA == 0:
            other = textures[(index + 1) % len(textures)].pixels[..., :3].mean(2)
            rows = np.arange(colour.shape[0]) % other.shape[0]
            columns = np.arange(colour.shape[1]) % other.shape[1]
            contrast = (other[rows][:, columns] - np.median(other)) * 8.0
            mask = np.clip(contrast + 128.0, 0, 255).astype(np.uint8)
            colour = np.dstack([colour, mask])
        found.append(SourceTexture(texture.name, colour, hash_pixels(colour), wrap=texture.wrap))
    return tuple(found)


def fitted_tables(textures: Sequence[SourceTexture], channels: int, seed: int = 0) -> BlockDecoder:
    """Tables of `channels` channels for textures that resemble none of `textures` in particular."""
    config = replace(UNIVERSAL_CONFIG, output_channels=channels)
    samples = sample_textures(textures, config, seed, most=BLOCKS_PER_TEXTURE * len(textures))
    return fit_decoder(samples, config, seed)


def main() -> int:
    """Fit and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="*", help="folders of images, or scenes: tables for base colours")
    parser.add_argument("--materials", type=Path, nargs="*", default=[], help="tables for whole materials")
    options = parser.parse_args()
    try:
        textures = permissive_textures(options.folders)
        kinds = ((3, [t for t in textures if t.pixels.shape[2] == 3]), (4, with_alpha(textures))) if textures else ()
        for channels, own in kinds:
            path = tables_path(VERSION, channels)
            write_bytes(path, save(universal_tensors(fitted_tables(own, channels))))
            print(f"{path}: {path.stat().st_size} bytes, from {len(own)} textures")
        if options.materials:
            materials, path = read_materials(options.materials), set_tables_path(SET_VERSION)
            write_bytes(path, save(fitted_set_tables(drawn_samples(materials))))
            print(f"{path}: {path.stat().st_size} bytes, from {len(materials)} materials")
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
