"""Export of a scene as glTF with its pack: `ntc-viewer export SCENE --pack F --out G.gltf`."""

import io
import json
import re
import shutil
import struct
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.maps import SRGB_MAPS
from ntc.codec.mips import mip_chain
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import PARTIAL_MARK, read_file, write_bytes
from ntc.pack.file import read_pack
from ntc.pack.match import require_match
from viewer.export import Fallback
from viewer.export.gltf.document import ALIGNMENT, GltfDocument, ImageFile, read_document
from viewer.export.gltf.options import PackOptions, add_options, held_whole, packed_options, remove_packs
from viewer.export.images import FORMATS
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import CHUNK_BINARY, CHUNK_JSON, GLB_MAGIC, GltfFile
from viewer.scene.gltf.maps.images import image_bytes
from viewer.scene.gltf.packed_textures import SWIZZLE, with_packed_images
from viewer.scene.gltf.textures import IMAGE_EXTENSIONS
from viewer.scene.images import ProgressReport, decode_image, is_constant
from viewer.scene.load import build_scene, open_container
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX, SCENE_SUFFIXES, scene_file
from viewer.state.pack_files import match_scene, same_place

LARGEST_GLB = (1 << 32) - 1
"""Largest size of a GLB in bytes: its header has 32 bits for the length."""
GLB_VERSION = 2
LONGEST_NAME = 120
"""Largest number of letters of an image's name in its file name."""


def files_folder(out: Path) -> Path:
    """Return the folder that has the buffers and images of the .gltf file `out`."""
    return out.with_name(f"{out.stem}.files")


def write_gltf(out: Path, document: GltfDocument) -> int:
    """Write `document` to the .gltf or .glb file `out`, and return the bytes of all files. The document is changed.

    Buffers and images of a .gltf go into the folder `files_folder`, which is replaced as a whole; a .glb contains them. Raises
    InputError where the files cannot be written; then all files are as they were.
    """
    if out.suffix.lower() == ".glb":
        return _write_glb(out, document)
    folder = files_folder(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.stem[:60]}.", suffix=PARTIAL_MARK))
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror}); choose a writable folder") from error
    try:
        content = made / "files"
        content.mkdir()
        byte_count = _write_files(document, content, folder.name)
        text = _json_bytes(document)
        (made / "scene.gltf").write_bytes(text)
        _take_places(out, made)
    except OSError as error:
        problem = f"{out}: cannot be written ({error.strerror or error}); check space and permissions"
        raise InputError(problem) from error
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return byte_count + len(text)


def _take_places(out: Path, made: Path) -> None:
    """Move the new file and folder from `made` to the places of `out` and its folder. After an error the old ones are restored."""
    folder, before, content = files_folder(out), made / "before", made / "files"
    if folder.exists():
        folder.rename(before)
    try:
        # An empty folder is not written.
        if any(content.iterdir()):
            content.rename(folder)
        (made / "scene.gltf").replace(out)
    except BaseException:
        if not content.exists():
            folder.rename(content)
        if before.exists():
            before.rename(folder)
        raise


def _json_bytes(document: GltfDocument) -> bytes:
    for key in [key for key, value in document.json.items() if value == []]:
        # glTF forbids empty arrays (glTF 2.0, JSON schema).
        del document.json[key]
    return json.dumps(document.json, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")


def _write_files(document: GltfDocument, folder: Path, name: str) -> int:
    """Write buffers and images into `folder`, name them in the document as files of a folder `name`, and return their bytes.

    Raises OSError and InputError.
    """
    taken: set[str] = set()
    byte_count = 0

    def write(wanted: str, data: bytes | NDArray[np.uint8]) -> str:
        nonlocal byte_count
        path = folder / _free_name(wanted, taken)
        with path.open("wb") as file:
            file.write(data if isinstance(data, bytes) else data.tobytes())
        byte_count += len(data)
        return quote(f"{name}/{path.name}")

    buffers = document.entries("buffers")
    for number, data in enumerate(document.buffers):
        if data is not None:
            buffers[number]["uri"] = write(f"buffer{number}.bin", data)
            buffers[number]["byteLength"] = len(data)
    for index, image in document.images.items():
        entry = document.entries("images")[index]
        entry["uri"] = write(image.name, image.read())
        if image.mime_type:
            entry["mimeType"] = image.mime_type
    return byte_count


def _free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted` as a file name that is valid on every system, numbered where it is in `taken`; it is added to `taken`."""
    name = re.sub(r'[\x00-\x1f<>:"/\\|?*]', "_", wanted).strip(" .") or "file"
    stem, dot, suffix = name.rpartition(".")
    stem, suffix = (stem[:LONGEST_NAME], f".{suffix[:10]}") if dot else (name[:LONGEST_NAME], "")
    candidate, number = f"{stem}{suffix}", 2
    while candidate.lower() in taken:
        candidate, number = f"{stem}_{number}{suffix}", number + 1
    taken.add(candidate.lower())
    return candidate


def _write_glb(out: Path, document: GltfDocument) -> int:
    parts = [document.merge_buffers()]
    length = len(parts[0])
    views = document.entries("bufferViews")
    for index, image in document.images.items():
        if not image.mime_type:
            problem = f"{image.name} is not an image that a .glb can hold (PNG, JPEG, WebP, KTX2); write a .gltf"
            raise InputError(f"{out}: {problem}")
        data = np.frombuffer(image.read(), np.uint8)
        entry = document.entries("images")[index]
        entry.pop("uri", None)
        entry["mimeType"], entry["bufferView"] = image.mime_type, len(views)
        views.append({"buffer": 0, "byteOffset": length, "byteLength": len(data)})
        parts.append(np.pad(data, (0, -len(data) % ALIGNMENT)))
        length += len(parts[-1])
    if length:
        document.entries("buffers")[0]["byteLength"] = length
    else:
        document.json.pop("buffers", None)
    text = _json_bytes(document)
    text += b" " * (-len(text) % ALIGNMENT)
    chunks = [struct.pack("<II", len(text), CHUNK_JSON), text]
    if length:
        chunks += [struct.pack("<II", length, CHUNK_BINARY), *(part.tobytes() for part in parts)]
    whole = 12 + sum(len(chunk) for chunk in chunks)
    if whole > LARGEST_GLB:
        raise InputError(f"{out}: would have {whole} bytes, a .glb has at most {LARGEST_GLB}; write a .gltf")
    write_bytes(out, b"".join([struct.pack("<4sII", GLB_MAGIC, GLB_VERSION, whole), *chunks]))
    return whole


JPEG_QUALITY = 90
"""Quality of libjpeg. Colour is not subsampled, because normals and roughness are not colours."""


def replaceable_images(document: GltfDocument, textures: set[int]) -> tuple[int, ...]:
    """Return the image entries that only the texture entries `textures` read."""
    entries = document.entries("textures")
    wanted = {index for number in textures for index in _images_of(entries[number])}
    others = {index for number, entry in enumerate(entries) if number not in textures for index in _images_of(entry)}
    return tuple(sorted(wanted - others))


def _images_of(texture: dict[str, Any]) -> set[int]:
    extensions = texture.get("extensions", {})
    owners = [texture, *(extensions[name] for name in IMAGE_EXTENSIONS if name in extensions)]
    return {owner["source"] for owner in owners if isinstance(owner.get("source"), int)}


@dataclass(frozen=True, eq=False)
class OpenedExport:
    """Scene and packs opened for an export as glTF."""

    file: GltfFile
    """File as it was read, with entries for images that only a pack has."""
    buffers: Buffers
    """Buffers of `file`, each read once."""
    scene: Scene
    packs: tuple[PackOptions, ...]
    document: GltfDocument
    """Document to change and write."""


def apply_fallback(opened: OpenedExport, textures: set[int], fallback: Fallback) -> int:
    """Replace the images of the texture entries `textures`, which a pack holds completely, and return the number of replaced images.

    Raises InputError for images that cannot be read, and for KTX2 without its encoder.
    """
    if fallback == "original":
        return 0
    document, file, buffers = opened.document, opened.file, opened.buffers
    images = replaceable_images(document, textures)
    if fallback == "none":
        document.remove_images(set(images))
        return len(images)
    if fallback == "ktx2":
        return _replace_by_ktx2(opened, images)
    replaced = 0
    for index in images:
        file_as_jpeg = _as_jpeg(file, buffers, index)
        if file_as_jpeg is not None:
            document.replace_image(index, file_as_jpeg)
            replaced += 1
    return replaced


def _as_jpeg(file: GltfFile, buffers: Buffers, index: int) -> ImageFile | None:
    """Return image entry `index` as JPEG; None where JPEG cannot store it."""
    name = file.label(file.entries("images")[index], f"image {index}")
    pixels = decode_image(image_bytes(file, buffers, index), f"{file.name}: images[{index}]")
    # JPEG has no alpha, and may turn an image with small differences into a constant one.
    if pixels.shape[2] != 3:
        return None
    data = jpeg(pixels)
    if is_constant(decode_image(data, name)):
        return None
    return ImageFile(f"{name.rsplit('.', 1)[0]}.jpg", "image/jpeg", lambda: data)


def _replace_by_ktx2(opened: OpenedExport, images: tuple[int, ...]) -> int:
    """Replace `images` by Basis Universal in KTX2, which textures name only by the extension, and return their number."""
    document, stored = opened.document, FORMATS["ktx2"]
    colors = {
        option.image
        for packed in opened.packs
        for options in packed.options.values()
        for option in options
        if SRGB_MAPS.intersection(name for _, name in option.references)
    }
    for index in images:
        name = opened.file.label(opened.file.entries("images")[index], f"image {index}")
        pixels = decode_image(image_bytes(opened.file, opened.buffers, index), f"{opened.file.name}: images[{index}]")
        srgb = index in colors
        data = stored.store(mip_chain(pixels, "srgb" if srgb else "linear"), srgb).data
        file = ImageFile(f"{name.rsplit('.', 1)[0]}{stored.suffix}", stored.mime_type, partial(_same, data))
        document.replace_image(index, file)
    for texture in document.entries("textures"):
        if texture.get("source") in images:
            texture.setdefault("extensions", {})[stored.extension] = {"source": texture.pop("source")}
    if images:
        document.use_extension(stored.extension, required=True)
    return len(images)


def _same(data: bytes) -> bytes:
    return data


def image_pixels(file: GltfFile, buffers: Buffers, index: int) -> NDArray[np.uint8] | None:
    """Return the pixels [H, W, 3 or 4] of image entry `index`; None where it cannot be read or only a pack has it."""
    try:
        return decode_image(image_bytes(file, buffers, index), f"{file.name}: images[{index}]")
    except InputError:
        return None


def jpeg(pixels: NDArray[np.uint8]) -> bytes:
    """Return `pixels` [H, W, 3] as a JPEG file."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return buffer.getvalue()


def check_out(out: Path, scene: Path) -> None:
    """Check the output file. Raises InputError where its name is not that of a glTF file, and where it is the scene itself."""
    if out.suffix.lower() not in SCENE_SUFFIXES:
        raise InputError(f"--out {out}: name a {' or '.join(SCENE_SUFFIXES)} file")
    if out.is_dir() or (files_folder(out).exists() and not files_folder(out).is_dir()):
        raise InputError(
            f"--out {out}: is a folder, or {files_folder(out).name} beside it is a file; name another file"
        )
    if out.exists() and same_place(out, scene):
        raise InputError(f"--out {out}: is the scene itself; name another file")


def open_export(
    scene_path: Path, pack_paths: Sequence[Path], out: Path, report: ProgressReport | None = None
) -> OpenedExport:
    """Open the scene at `scene_path` with the packs at `pack_paths` for an export to `out`.

    Raises InputError for unreadable files, for a pack of another scene and for an unusable `out` (`check_out`), and what `report`
    raises.
    """
    scene_path = scene_file(scene_path)
    check_out(out, scene_path)
    file = open_container(scene_path)
    packs = [read_pack(path) for path in pack_paths]
    scene = build_scene(file, scene_path.stem, scene_path, report=report)
    matches = [match_scene(pack, scene) for pack in packs]
    for pack, match in zip(packs, matches, strict=True):
        require_match(pack, match, scene.name)
    buffers = Buffers(file)
    document = read_document(file, buffers)
    remove_packs(document)
    file = with_packed_images(file)
    options = tuple(
        PackOptions(pack, match, packed_options(file, scene, pack, match.texture_index))
        for pack, match in zip(packs, matches, strict=True)
    )
    return OpenedExport(file, buffers, scene, options, document)


@dataclass(frozen=True)
class ExportedScene:
    """Summary of an exported scene."""

    out: Path
    pack: Path
    scene_bytes: int
    """Bytes of the glTF file with its buffers and images."""
    pack_bytes: int
    textures: int
    """Number of the scene's textures that the pack holds."""
    of_textures: int
    """Number of the scene's textures."""
    replaced: int
    """Number of images that were replaced or left out."""
    missing: tuple[str, ...]
    """Messages about images that could not be read."""


def exported_pack_path(out: Path, pack: Pack) -> Path:
    """Return the path of the pack of an exported scene: beside the scene, under the name by which the viewer opens it."""
    return out.with_name(f"{out.stem}.{pack.grouping.name}{PACK_SUFFIX}")


def export_gltf(
    scene_path: Path, pack_path: Path, out: Path, fallback: Fallback, report: ProgressReport | None = None
) -> ExportedScene:
    """Write the scene at `scene_path` to `out`, whose textures also name the pack at `pack_path`, and copy the pack beside it.

    Raises InputError, and what `report` raises; then nothing is written.
    """
    opened = open_export(scene_path, (pack_path,), out, report)
    document, (packed,) = opened.document, opened.packs
    whole = held_whole(opened.file, opened.scene, packed.options)
    replaced = apply_fallback(opened, whole, fallback)
    # A pack that already lies beside the new file is not copied.
    beside = same_place(pack_path.parent, out.parent) and pack_path.exists()
    target = pack_path if beside else exported_pack_path(out, packed.pack)
    add_options(document, opened.packs, (quote(target.name),))
    if fallback == "none" and replaced:
        document.use_extension(SWIZZLE, required=True)
    existed = target.exists()
    if not beside:
        write_bytes(target, read_file(pack_path))
    try:
        written = write_gltf(out, document)
    except BaseException:
        if not existed:
            target.unlink(missing_ok=True)
        raise
    return ExportedScene(
        out,
        target,
        written,
        target.stat().st_size,
        packed.match.matched,
        len(opened.scene.textures),
        replaced,
        tuple(document.missing),
    )
