"""`export --web`: writes the folder of a page."""

import json
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from ntc.codec.maps import MAP_CHANNELS, PLANE_COMPONENTS, Plane
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import atomic_folder
from viewer.export.web.description import (
    FORMAT,
    PageFile,
    TextureFiles,
    describe_figures,
    describe_material,
    describe_texture,
    describe_view,
    texture_planes,
)
from viewer.export.web.geometry import scene_glb
from viewer.export.web.light import SIDES, sky_cube
from viewer.export.web.packed import (
    PackedTexture,
    decoding_shaders,
    packed_decoders,
    packed_textures,
    plane_picture,
    webp,
)
from viewer.lighting.sky import sun_of
from viewer.scene.images import ProgressReport, map_in_threads
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene
from viewer.state.view_state import DEFAULT_LIGHTING

PAGE = Path(__file__).resolve().parent / "page"
"""The files that every page has: built by `source/build.py`."""
DESCRIPTION = "page.json"
Originals = Literal["lossless", "none"]


@dataclass(frozen=True)
class PageSummary:
    """Summary of an exported page."""

    files: int
    total_bytes: int
    pack_bytes: int
    """Bytes of latents, decoders and whatever else the page reads to decode."""
    original_bytes: int
    """Bytes of pictures that are read only when the page compares."""


class _Writer:
    """Writes files below a folder and knows their sums."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.sizes: dict[str, int] = {}

    def write(self, name: str, data: bytes) -> PageFile:
        """Return a file, and how the page finds it."""
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        self.sizes[name] = len(data)
        return PageFile(name, len(data), zlib.crc32(data))

    def total(self, prefix: str = "") -> int:
        """Return the bytes of the files whose names begin so."""
        return sum(size for name, size in self.sizes.items() if name.startswith(prefix))


def _chosen(pack: Pack, scene: Scene) -> dict[int, int]:
    """Return the index in the pack of each texture of the scene that the pack holds and a material reads."""
    match = match_scene(pack, scene)
    read = {texture for material in scene.materials for texture in map(material.plane_texture, PLANE_COMPONENTS)}
    found = {own: index for own, index in enumerate(match.texture_index) if index >= 0 and own in read}
    if not found:
        raise InputError(f"{pack.name}: made for another scene than {scene.name}: {match.line()}; encode this scene")
    return found


def _texture_files(
    writer: _Writer, scene: Scene, pack: Pack, originals: Originals, job: tuple[int, int, int, PackedTexture]
) -> TextureFiles:
    """Write the files of texture `job[0]` of the page, which is `job[1]` of the scene and `job[2]` of the pack."""
    number, own, index, packed = job
    source, name = scene.textures[own], f"{number:05d}"
    planes: tuple[Plane, ...] = texture_planes(pack.textures[index]) if originals != "none" else ()
    pictures = {
        plane: writer.write(f"originals/{name}.{plane}.webp", webp(plane_picture(source, plane), source.name))
        for plane in planes
    }
    coverage = source.alpha
    alpha = writer.write(f"alpha/{name}.webp", webp(coverage, source.name)) if coverage is not None else None
    data = writer.write(f"textures/{name}.bin", packed.record + packed.levels + packed.latents)
    return TextureFiles(data, len(packed.record), len(packed.levels), pictures, alpha)


def export_page(
    scene: Scene, pack: Pack, destination: Path, originals: Originals = "lossless", report: ProgressReport | None = None
) -> PageSummary:
    """Write into the folder `destination` a page that shows `scene` with `pack`, as a whole or not at all.

    Texture by texture: no more pixels are held than cores work on. `report` is told how many textures are written. Raises InputError
    for a pack of another scene, and where the folder cannot be written.
    """
    chosen = _chosen(pack, scene)
    indices = list(chosen.values())
    with atomic_folder(destination, DESCRIPTION) as folder:
        writer = _Writer(folder)
        for path in sorted(PAGE.iterdir()):
            writer.write(path.name, path.read_bytes())
        glb = writer.write("scene.glb", scene_glb(scene))
        shaders = {
            plane: writer.write(f"shaders/{plane}.frag", text.encode()).json()
            for plane, text in decoding_shaders(pack).items()
        }
        decoders = packed_decoders(pack, indices)
        weights = writer.write("decoders.bin", decoders.data)
        jobs = zip(range(len(chosen)), chosen, indices, packed_textures(pack, indices), strict=True)
        write: Callable[[tuple[int, int, int, PackedTexture]], TextureFiles]
        write = partial(_texture_files, writer, scene, pack, originals)
        files = map_in_threads(write, jobs, report)
        pixel_bytes = sum(
            scene.textures[own].size[0] * scene.textures[own].size[1] * MAP_CHANNELS[name]
            for own, index in chosen.items()
            for name in pack.textures[index].maps
        )
        page = {own: number for number, own in enumerate(chosen)}
        texture_index = [chosen.get(own, -1) for own in range(len(scene.textures))]
        content: dict[str, Any] = {
            "format": FORMAT,
            "name": scene.name,
            "scene": glb.json(),
            "shaders": shaders,
            "decoders": {
                **weights.json(),
                "integer": decoders.is_integer,
                "rows": decoders.rows,
                "loop_length": decoders.loop_length,
            },
            "textures": [
                describe_texture(pack, pack.textures[index], own) for index, own in zip(indices, files, strict=True)
            ],
            "materials": [describe_material(own, pack, texture_index, page) for own in scene.materials],
            "figures": describe_figures(pack, scene, indices, pixel_bytes),
            "sky": {**writer.write("sky.bin", sky_cube(DEFAULT_LIGHTING)).json(), "sides": SIDES},
            "sun": asdict(sun_of(DEFAULT_LIGHTING)),
            **describe_view(scene),
        }
        writer.write(DESCRIPTION, json.dumps(content, allow_nan=False, separators=(",", ":")).encode())
        packed = writer.total("textures/") + writer.total("decoders.bin")
        return PageSummary(len(writer.sizes), writer.total(), packed, writer.total("originals/"))
