"""Scene, packs, camera and precision that the options name."""

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
"""Missing things that are listed one by one; the others are only counted."""


def open_scene(path: Path | None, variant: str = "", pose: Pose | None = None) -> Scene:
    """Load the scene that `path` names, or the courtyard, and print notes about missing parts; progress where there is a terminal.

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
    """Load a scene; a terminal shows how many images are read, and the time left. Raises InputError."""
    with TerminalProgress(f"opening {path.name}", "images") as report:
        return load_scene(path, variant, pose, report)


def packs_for(scene: Scene, named: tuple[Path, ...]) -> dict[str, Pack]:
    """Open the packs of a scene, by name: those named first, then those that the scene's file names, then those beside it.

    Raises InputError for one that cannot be read, or that is named and holds no texture of the scene.
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
    """Name of the open pack to show, REFERENCE, or a block format.

    A grouping that is asked for must be there (InputError says how to get it). Without one, the first pack
    that was named is shown, else the clustered one, else any, else the reference.
    """
    if grouping is not None and is_image_source(grouping):
        return grouping
    if grouping is not None:
        found = source_of_grouping(packs, grouping)
        if found is None:
            there = ", ".join([REFERENCE, *packs, "bc1", "bc7", "astc-4x4 to astc-12x12"])
            raise InputError(
                f"--grouping {grouping}: no such pack for this scene (there are: {there}); "
                f"make one with: ntc-viewer encode SCENE --grouping {grouping} --out SCENE_NAME.{grouping}.ntc"
            )
        return found
    if named:
        return next(iter(packs))
    return preferred_source(packs)


def compress_scene(scene: Scene, block_format: BlockFormat) -> CompressedTextures:
    """Return the scene's textures in a format of graphics hardware, kept in the user's cache; progress where there is a terminal.

    Raises InputError where the encoder is not installed.
    """
    requests = compression_requests(scene, block_format, cache_folder("blocks"))
    pictures = [request for own in requests for request in own]
    with TerminalProgress(f"encoding {block_format}", "images") as report:
        pool = ThreadPoolExecutor(os.cpu_count() or 1)
        try:
            found = []
            for texture in pool.map(compress_texture, pictures):
                found.append(texture)
                report.progress(len(found), len(pictures))
        finally:
            # After an error, and Ctrl-C, nothing more is begun.
            pool.shutdown(cancel_futures=True)
    return compressed_scene(block_format, requests, found)


def choose_camera(scene: Scene, options: RenderOptions) -> Camera:
    """Return the camera that the options name, else the scene's first, else one that frames all. Raises InputError."""
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
    """Return the precision that `choice` means for `pack`; for `auto` the chosen one and the reason are printed.

    `fastest_first` has the driver's precisions; by default those that every driver supports.
    """
    if choice != "auto":
        return choice
    if pack is None:
        return "fp32"
    chosen = codec_of(pack.config).chosen_precision(pack, fastest_first)
    sys.stdout.write(f"precision {chosen.precision}: {chosen.reason}\n")
    return chosen.precision
