"""Folder of a web page (`export --web`). The page draws the exported glTF with three.js and the plug-in of integrations/three."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import ntc
from ntc.codec.model import Pack
from ntc.io import atomic_folder, read_file
from ntc.metrics.metrics import bits_with_mips, psnr_table
from viewer.export.gltf.export import OpenedExport, apply_fallback, open_export, write_gltf
from viewer.export.gltf.options import PackOptions, add_options, held_whole
from viewer.export.web.light import SIDES, sky_cube
from viewer.export.web.plain import make_plain
from viewer.lighting.sky import sun_of
from viewer.locations import three_folder
from viewer.scene.images import ProgressReport
from viewer.scene.model import Camera, Scene
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.camera import clip_distances
from viewer.state.framing import frame_all
from viewer.state.view_state import DEFAULT_LIGHTING

FORMAT: Final = 2
"""Version of `page.json`. Each change that an older page would misread raises it."""
DESCRIPTION: Final = "page.json"
SCENE: Final = "scene.gltf"
HERE: Final = Path(__file__).resolve().parent
VENDOR_FILES: Final = ("three.js", "LICENSE")
PLUGIN_FILES: Final = ("index.js", "pack.js", "textures.js", "worker.js", "generated/ntc.wasm")
PLANES: Final = ("base", "surface", "emission")


@dataclass(frozen=True)
class PageSummary:
    """Summary of an exported page."""

    files: int
    total_bytes: int
    pack_bytes: int
    """Bytes of the packs."""
    image_bytes: int
    """Bytes of the original images, which the page loads only when it shows them."""
    missing: tuple[str, ...]
    """Messages about images that could not be read."""


def export_page(
    scene_path: Path,
    pack_paths: Sequence[Path],
    destination: Path,
    with_originals: bool = True,
    report: ProgressReport | None = None,
) -> PageSummary:
    """Write a page that shows the scene with the packs at `pack_paths` into the folder `destination`, completely or not at all.

    With `with_originals` the page has all original images for comparison, without it only those that a pack lacks. Raises InputError
    for a pack of another scene and where the folder cannot be written, and what `report` raises.
    """
    with atomic_folder(destination, DESCRIPTION) as folder:
        opened = open_export(scene_path, pack_paths, folder / SCENE, report)
        make_plain(opened)
        if not with_originals:
            wholes = [held_whole(opened.file, opened.scene, packed.options) for packed in opened.packs]
            apply_fallback(opened, set.intersection(*wholes), "none")
        names = _write_packs(opened, pack_paths, folder)
        add_options(opened.document, opened.packs, [quote(name) for name in names])
        write_gltf(folder / SCENE, opened.document)
        _copy_program(opened, folder)
        (folder / "sky.bin").write_bytes(sky_cube(DEFAULT_LIGHTING))
        description = _description(opened, names, with_originals)
        (folder / DESCRIPTION).write_text(json.dumps(description, allow_nan=False, separators=(",", ":")))
        sizes = {path.relative_to(folder): path.stat().st_size for path in folder.rglob("*") if path.is_file()}
        return PageSummary(
            len(sizes),
            sum(sizes.values()),
            sum(sizes[Path(name)] for name in names),
            sum(size for path, size in sizes.items() if path.parent.name == "scene.files" and path.suffix != ".bin"),
            tuple(opened.document.missing),
        )


def _write_packs(opened: OpenedExport, paths: Sequence[Path], folder: Path) -> list[str]:
    """Copy the packs into `folder` and return their names there, all different."""
    names: list[str] = []
    for packed, path in zip(opened.packs, paths, strict=True):
        stem = f"scene.{packed.pack.grouping.name}"
        names.append(
            f"{stem}{PACK_SUFFIX}" if f"{stem}{PACK_SUFFIX}" not in names else f"{stem}.{len(names)}{PACK_SUFFIX}"
        )
        (folder / names[-1]).write_bytes(read_file(path))
    return names


def _copy_program(opened: OpenedExport, folder: Path) -> None:
    """Copy the page, three.js, the plug-in, and the tables that decode packs of grouping `universal`."""
    files = [(path, path.name) for path in sorted((HERE / "page").iterdir())]
    files += [(HERE / "vendor" / name, f"vendor/{name}") for name in VENDOR_FILES]
    files += [(three_folder() / name, f"ntc-three/{name}") for name in PLUGIN_FILES]
    for codec in {packed.pack.config.kind for packed in opened.packs if packed.pack.grouping.name == "universal"}:
        tables = Path(ntc.__path__[0], "codec", codec).glob("universal_*.safetensors")
        files += [(path, f"ntc-three/{path.name}") for path in tables]
    for source, name in files:
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        shutil.copyfile(source, folder / name)


def _description(opened: OpenedExport, names: Sequence[str], with_originals: bool) -> dict[str, Any]:
    """Return the content of `page.json`."""
    scene = opened.scene
    sources: list[dict[str, Any]] = [
        {
            "name": Path(packed.pack.path or name).name.removesuffix(PACK_SUFFIX),
            "pack": quote(name),
            "decoders": _decoders(packed, scene),
            "figures": _figures(packed.pack),
        }
        for packed, name in zip(opened.packs, names, strict=True)
    ]
    if with_originals:
        sources.append({"name": "Reference", "pack": None, "decoders": [], "figures": []})
    triangles = sum(scene.primitives[number].index_count // 3 for number in scene.instances.primitive.tolist())
    return {
        "format": FORMAT,
        "name": scene.name,
        "scene": SCENE,
        "sources": sources,
        "materials": len(scene.materials),
        "figures": [["Scene", f"{triangles:,} triangles, {len(scene.materials)} materials"]],
        "sky": {"sides": SIDES},
        "sun": asdict(sun_of(DEFAULT_LIGHTING)),
        "bounds": scene.bounds.tolist(),
        "cameras": [_camera(scene, camera) for camera in scene.cameras or (frame_all(scene),)],
    }


def _decoders(packed: PackOptions, scene: Scene) -> list[int]:
    """Return the decoder of each material of `scene`: that of its base colour, else of its other maps; -1 where nothing is decoded."""
    decoders: list[int] = []
    for material in scene.materials:
        textures = [material.plane_texture(plane) for plane in PLANES]
        layers = [packed.match.texture_index[texture] for texture in textures if texture >= 0]
        decoders.append(next((packed.pack.textures[layer].group for layer in layers if layer >= 0), -1))
    return decoders


def _figures(pack: Pack) -> list[tuple[str, str]]:
    """Return figures of `pack` as (name, value)."""
    table = psnr_table(pack)
    size = table.latent_bytes + table.decoder_bytes + table.adapter_bytes
    lines = [
        ("Codec", f"{pack.config.kind}, {pack.grouping.name}"),
        ("Decoders", f"{len({texture.group for texture in pack.textures})} for {len(pack.textures)} textures"),
        ("Stored", f"{size / 1e6:.1f} MB, {bits_with_mips(pack):.2f} bits per texel"),
    ]
    if table.summary is not None:
        summary = table.summary
        lines.append(("PSNR", f"{summary.of_mean_mse_db:.1f} dB, worst texture {summary.minimum_db:.1f} dB"))
    return lines


def _camera(scene: Scene, camera: Camera) -> dict[str, Any]:
    near, far = clip_distances(camera, scene.bounds)
    return {
        "name": camera.name,
        "eye": camera.eye,
        "target": camera.target,
        "fov": camera.fov_degrees,
        "height": camera.orthographic_height,
        "near": near,
        "far": far,
    }
