"""Command lines of ntc-viewer for the add-on, and reading of their results. Nothing of Blender is imported."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

SWIZZLE = "NV_texture_swizzle"
TEXTURE_PLACES: Mapping[str, tuple[str, ...]] = {
    "base": ("pbrMetallicRoughness", "baseColorTexture"),
    "roughness": ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    "metalness": ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    "normal": ("normalTexture",),
    "emissive": ("emissiveTexture",),
}
"""Places where glTF materials name the texture of each map."""
COMPONENTS: Mapping[str, tuple[int, ...]] = {
    "base": (0, 1, 2),
    "roughness": (1,),
    "metalness": (2,),
    "normal": (0, 1, 2),
    "emissive": (0, 1, 2),
}
"""Components of the texture that hold each map."""


@dataclass(frozen=True)
class MaterialRow:
    """Size and quality of the textures of one material."""

    material: str
    bits: float
    """Mean bitrate of its textures in bits per texel, mips included."""
    byte_count: int
    """Size of its latents in bytes."""
    psnr_db: float
    """PSNR of its worst texture, in dB."""


@dataclass(frozen=True)
class Encoded:
    """The result of encoding a scene, in a folder."""

    folder: Path
    rows: tuple[MaterialRow, ...]
    images: Mapping[tuple[str, str], Path]
    """Decoded images by (material, map), with components as in glTF."""

    @property
    def pack_bytes(self) -> int:
        """Size of the pack, in bytes."""
        return pack_path(self.folder).stat().st_size


def scene_path(folder: Path) -> Path:
    """Return the path that Blender writes the scene to."""
    return folder / "scene.glb"


def pack_path(folder: Path) -> Path:
    """Return the path of the scene's pack."""
    return folder / "scene.ntc"


def encode_commands(program: Sequence[str], folder: Path, target: Sequence[str]) -> list[list[str]]:
    """Return the commands that encode the scene in `folder` and decode it again. `target` is, for example, ("--bits", "4")."""
    scene, pack = str(scene_path(folder)), str(pack_path(folder))
    export = [*program, "export", scene, "--pack", pack, "--out"]
    return [
        [*program, "encode", scene, "--out", pack, "--grouping", "universal", "--maps", "all", *target],
        [*program, "info", pack, "--json"],
        [*export, str(folder / "packed.gltf")],
        [*export, str(folder / "decoded.gltf"), "--as", "png"],
    ]


def export_command(program: Sequence[str], folder: Path, out: Path, fallback: str) -> list[str]:
    """Return the command that writes the encoded scene to `out`, with its pack beside it."""
    scene, pack = str(scene_path(folder)), str(pack_path(folder))
    return [*program, "export", scene, "--pack", pack, "--out", str(out), "--fallback", fallback]


def _json(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def _texture(material: Mapping[str, Any], name: str) -> int | None:
    entry: Any = material
    for key in TEXTURE_PLACES[name]:
        entry = entry.get(key, {})
    index = entry.get("index")
    return index if isinstance(index, int) else None


def read_encoded(folder: Path, info: str) -> Encoded:
    """Read the results of `encode_commands`. `info` is the output of the second command."""
    textures = json.loads(info)["textures"]
    packed, decoded = _json(folder / "packed.gltf"), _json(folder / "decoded.gltf")
    rows, images = [], {}
    for material, other in zip(packed.get("materials", []), decoded.get("materials", []), strict=True):
        layers = {}
        for name in TEXTURE_PLACES:
            index = _texture(material, name)
            options = packed["textures"][index].get("extensions", {}).get(SWIZZLE) if index is not None else None
            if options is None:
                continue
            option = options["options"][0]
            if all(option["channels"][part] < 0 for part in COMPONENTS[name]):
                continue
            layers[option["arrayLayer"]] = textures[option["arrayLayer"]]
            source = decoded["textures"][_texture(other, name)]["source"]
            images[material["name"], name] = folder / unquote(decoded["images"][source]["uri"])
        if layers:
            layer_textures = list(layers.values())
            bits = [layer["latent_bits_per_texel"] for layer in layer_textures]
            texels = [layer["width"] * layer["height"] for layer in layer_textures]
            byte_count = round(sum(each * count for each, count in zip(bits, texels, strict=True)) / 8)
            worst = min(layer["psnr_db"] or 0.0 for layer in layer_textures)
            rows.append(MaterialRow(material["name"], sum(bits) / len(bits), byte_count, worst))
    return Encoded(folder, tuple(rows), images)
