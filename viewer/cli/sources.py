"""Opening of the scene, packs, camera and precision that options name."""

import math
import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ntc.codec.config import Precision, PrecisionChoice
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.library.index import is_library
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures, compress_texture
from ntc.pack.match import require_match
from viewer.cli.options import RenderOptions
from viewer.cli.progress import TerminalProgress
from viewer.locations import builtin_scene_path, cache_folder, named_scene
from viewer.render.resources.decoding_shaders import EVERYWHERE
from viewer.scene.cameras_file import find_camera, read_cameras
from viewer.scene.load import load_scene
from viewer.scene.map_pictures import compressed_scene, compression_requests
from viewer.scene.model import Camera, Pose, Scene
from viewer.state.framing import frame_all
from viewer.state.pack_files import (
    match_scene,
    open_packs,
    packs_of,
    preferred_source,
    source_of_grouping,
    wanted_textures,
)
from viewer.state.view_state import REFERENCE, is_image_source

MISSING_SHOWN = 3
"""Most missing files and parts that are listed; the others are counted."""


def open_scene(path: Path | None, variant: str = "", pose: Pose | None = None) -> Scene:
    """Return the scene that `path` names, or the courtyard, loaded with progress on a terminal. Missing parts are printed.

    Raises InputError.
    """
    file = named_scene(path) if path is not None else builtin_scene_path()
    scene = load_with_progress(file, variant, pose)
    missing = scene.report.missing
    for line in missing[:MISSING_SHOWN]:
        sys.stderr.write(f"note: {line}\n")
    if len(missing) > MISSING_SHOWN:
        sys.stderr.write(
            f"note: {len(missing) - MISSING_SHOWN} more files or parts could not be read; see ntc-viewer info {path}\n"
        )
    return scene


def load_with_progress(path: Path, variant: str = "", pose: Pose | None = None) -> Scene:
    """Return a loaded scene. A terminal shows the number of images read, and the time left. Raises InputError."""
    with TerminalProgress(f"opening {path.name}", "images") as report:
        return load_scene(path, variant, pose, report)


def packs_for(scene: Scene, named: tuple[Path, ...]) -> dict[str, Pack]:
    """Return the opened packs of a scene, by name: first those in `named`, then those that the scene's file names, then those
    beside it.

    Raises InputError for a pack that cannot be read, and for a named pack without a texture of the scene.
    """
    packs = open_packs([*named, *packs_of(scene)], wanted_textures(scene))
    for path in named:
        if not any(pack.path == path for pack in packs.values()) and is_library(path):
            raise InputError(
                f"{path}: the library holds no texture of {scene.name}; encode the scene with --out {path}"
            )
    for pack in packs.values():
        match = match_scene(pack, scene)
        if pack.path in named:
            require_match(pack, match, scene.name)
        if match.absent:
            sys.stderr.write(f"note: {pack.path}: {match.line()}; the others show their factor\n")
    return packs


def choose_source(packs: Mapping[str, Pack], grouping: str | None, named: tuple[Path, ...]) -> str:
    """Return the source to show: the name of an open pack, REFERENCE, or a block format.

    With `grouping`, that source; InputError says how to make a pack that is missing. Without, the first of the packs `named`, else
    the clustered pack, else any, else the reference.
    """
    if grouping is not None and is_image_source(grouping):
        return grouping
    if grouping is not None:
        source = source_of_grouping(packs, grouping)
        if source is None:
            there = ", ".join([REFERENCE, *packs, "bc1", "bc7", "astc-4x4 to astc-12x12"])
            raise InputError(
                f"--grouping {grouping}: no such pack for this scene (there are: {there}); "
                f"make one with: ntc-viewer encode SCENE --grouping {grouping} --out SCENE_NAME.{grouping}.ntc"
            )
        return source
    if named:
        return next(iter(packs))
    return preferred_source(packs)


def compress_scene(scene: Scene, block_format: BlockFormat) -> CompressedTextures:
    """Return the scene's textures compressed to a block format, and cached in the user's cache folder. A terminal shows progress.

    Raises InputError where the encoder is not installed.
    """
    requests = compression_requests(scene, block_format, cache_folder("blocks"))
    pictures = [request for of_texture in requests for request in of_texture]
    with TerminalProgress(f"encoding {block_format}", "images") as report:
        pool = ThreadPoolExecutor(os.cpu_count() or 1)
        try:
            compressed = []
            for texture in pool.map(compress_texture, pictures):
                compressed.append(texture)
                report.progress(len(compressed), len(pictures))
        finally:
            # After an error or Ctrl-C, no further picture is begun.
            pool.shutdown(cancel_futures=True)
    return compressed_scene(block_format, requests, compressed)


def choose_camera(scene: Scene, options: RenderOptions) -> Camera:
    """Return the camera that the options name, else the scene's first, else one that frames the scene. Raises InputError."""
    if (options.eye is None) != (options.target is None):
        raise InputError("--eye and --target belong together: give both")
    if options.eye is not None and options.target is not None:
        if options.camera is not None or options.cameras is not None:
            raise InputError("--eye/--target and --camera/--cameras exclude each other: give one of them")
        if not 0.0 < options.fov < 180.0:
            raise InputError(f"--fov {options.fov}: must lie between 0 and 180 degrees")
        if math.dist(options.eye, options.target) == 0.0:
            raise InputError("--eye and --target are the same point: no direction to look in")
        return Camera(name="command line", eye=options.eye, target=options.target, fov_degrees=options.fov)
    cameras = read_cameras(options.cameras) if options.cameras is not None else scene.cameras
    if options.camera is not None:
        return find_camera(cameras, options.camera)
    return cameras[0] if cameras else frame_all(scene, aspect=options.size[0] / options.size[1])


def resolve_precision(
    choice: PrecisionChoice, pack: Pack | None, fastest_first: Sequence[Precision] = EVERYWHERE[::-1]
) -> Precision:
    """Return the precision that `choice` means for `pack`. For `auto`, the chosen precision and the reason are printed.

    `fastest_first`: precisions of the driver, the fastest first; by default those that every driver supports.
    """
    if choice != "auto":
        return choice
    if pack is None:
        return "fp32"
    chosen = codec_of(pack.config).chosen_precision(pack, fastest_first)
    sys.stdout.write(f"precision {chosen.precision}: {chosen.reason}\n")
    return chosen.precision
