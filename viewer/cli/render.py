"""`ntc-viewer render`: draws one picture without a window, with ids, divergence and statistics."""

import io
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ntc.codec.quality import finite_or_none
from ntc.errors import InputError
from ntc.io import write_bytes, write_text
from ntc.metrics.block_compression import named_format
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.capture.pictures import ERROR_AMPLIFICATION, error_overlay, material_aovs, with_color_bar, write_aovs
from viewer.cli.builtin_packs import packs_with
from viewer.cli.options import RenderOptions
from viewer.cli.sources import choose_camera, choose_source, compress_scene, open_scene, resolve_precision
from viewer.gl.context import create_headless_context
from viewer.inspect.measurement import MapError, MeasuredPicture, WholeDrawing, errors_by_map, measure
from viewer.jobs.job import Background
from viewer.lighting.panorama import load_panorama
from viewer.render.frames import FrameResult, read_picture
from viewer.render.resources.decoding_shaders import fastest_first
from viewer.scene.images import write_png
from viewer.scene.model import Pose, Scene
from viewer.state.event_handlers import apply_event
from viewer.state.events import TexturesCompressed, ViewChanged
from viewer.state.open_files import InitialView, new_session
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import (
    BLOCKS,
    BUILTIN_ENVIRONMENTS,
    SKY,
    Lighting,
    Overlay,
    OverlayKind,
    Slot,
    ViewState,
    is_image_source,
)


def map_error_statistics(errors: Sequence[MapError], scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the errors by map for stats.json: PSNR in dB and mean squared error (squared 8-bit steps) of the picture, and the
    texture with the largest share of the error, or null."""
    statistics = {}
    for error in errors:
        total = float(error.by_texture.sum())
        worst = int(error.by_texture.argmax()) if total > 0.0 else None
        statistics[str(error.maps)] = {
            "psnr_db": error.psnr_db,
            "mean_squared_error": error.mean_squared_error,
            "worst_texture": None if worst is None else scene.textures[worst].name,
            "share_of_worst_texture": None if worst is None else float(error.by_texture[worst]) / total,
        }
    return statistics


def write_map_errors(folder: Path, errors: Sequence[MapError]) -> None:
    """Write error.MAP.png for each map: the error of every pixel, amplified as in the error overlay, black for no error."""
    for error in errors:
        steps = np.minimum(np.sqrt(error.squared_error) * ERROR_AMPLIFICATION, 255.0)
        write_png(folder / f"error.{error.maps}.png", np.rint(steps).astype(np.uint8))


WARM_UP_DIVISOR = 16
"""Ratio of the picture's size to that of a first frame, which compiles programs and uploads textures: `timings_ms` then holds only
drawing."""


def compression_statistics(compressed: CompressedTextures) -> dict[str, Any]:
    """Return the part of stats.json about textures in a block format: bytes and bits of all mips, PSNR of mip 0 in dB."""
    psnr = compressed.psnr
    summary = {name: finite_or_none(value) for name, value in vars(psnr).items()} if psnr is not None else None
    size = {"bytes": compressed.stored_bytes, "bits_per_texel": compressed.bits_per_texel}
    return {"format": compressed.block_format, "textures": len(compressed.textures), **size, "psnr_db": summary}


def statistics(measured: MeasuredPicture, frame: FrameResult, view: ViewState, renderer_name: str) -> dict[str, Any]:
    """Return the other parts of stats.json. PSNR is in dB, over 8-bit sRGB RGB of the covered pixels. It is null for the reference,
    and where both pictures are equal, because JSON has no infinity.
    """
    divergence, is_image = measured.divergence_statistics, is_image_source(measured.source)
    decoded = measured.decoder_ids >= 0
    return {
        "renderer": renderer_name,
        "size": list(view.size),
        "grouping": measured.source,
        "path": None if is_image else frame.paths[view.slot_a],
        "precision": None if is_image else view.slot_a.precision,
        "filter": None if is_image else "stochastic" if view.slot_a in frame.samples else "exact",
        "samples": frame.samples.get(view.slot_a, 1),
        "blend_samples": frame.blend_samples.get(view.slot_a, 1),
        "camera": view.camera.name,
        "view": view.material_view,
        "lighting": asdict(view.lighting) if view.material_view == "lit" else None,
        "timer": frame.timer,
        "timings_ms": frame.timings_ms,
        "blocking_calls": frame.blocking_calls,
        "to_come": [item.line for item in frame.pending],
        "pixels": {"covered": int(measured.covered.sum()), "decoded": int(decoded.sum())},
        "divergence": {
            "score": divergence.score,
            "excess": divergence.excess,
            "divergent_blocks": divergence.divergent_blocks,
            "max": divergence.maximum,
            "mean": divergence.mean,
            "wave_efficiency": divergence.wave_efficiency,
            "histogram": list(divergence.histogram),
            "block": list(BLOCKS[view.overlay.block]),
        },
        "psnr_db": finite_or_none(measured.psnr_db(measured.covered)),
        "psnr_decoded_pixels_db": finite_or_none(measured.psnr_db(decoded)),
        "skipped": frame.skipped,
        "tiles": {slot.path: asdict(counts) for slot, counts in frame.tiles.items()},
        "loads": {slot.path: counts.figures() for slot, counts in frame.loads.items()},
    }


def _npy(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def write_picture(
    folder: Path,
    measured: MeasuredPicture,
    shown: NDArray[np.uint8],
    stats: dict[str, Any],
    kind: str,
    overlay: Overlay,
) -> None:
    """Write the files of `render` into `folder`, stats.json last. `kind` is the overlay in `overlay.png`, "none" for no such file.

    `shown` [H, W, 3] uint8 sRGB is the picture with the overlay.
    """
    write_png(folder / "color.png", measured.color)
    write_bytes(folder / "texture_id.npy", _npy(measured.texture_ids))
    write_bytes(folder / "decoder_id.npy", _npy(measured.decoder_ids))
    write_bytes(folder / "divergence.npy", _npy(measured.divergence))
    if kind == "divergence":
        most = overlay.most(int(measured.divergence.max(initial=0)))
        write_png(folder / "overlay.png", with_color_bar(shown, overlay.palette, most))
    elif kind == "error":
        write_png(folder / "overlay.png", error_overlay(measured.color, measured.reference))
    write_text(folder / "stats.json", json.dumps(stats, indent=2, allow_nan=False) + "\n")


def chosen_lighting(options: RenderOptions) -> Lighting:
    """Return the light of --view lit. Raises InputError for values out of range, and for a panorama that cannot be read."""
    environment = SKY if options.environment is None else str(options.environment)
    if options.environment is not None and environment not in BUILTIN_ENVIRONMENTS:
        # Read now, so that a broken file is refused before anything is drawn.
        load_panorama(options.environment)
    given: dict[str, Any] = {
        "environment": environment,
        "sun_azimuth": options.sun[0] % 360.0 if math.isfinite(options.sun[0]) else options.sun[0],
        "sun_elevation": options.sun[1],
        "sun_strength": options.sun_strength if options.sun_strength is not None else float(environment == SKY),
        "exposure": options.exposure,
        "tone_map": options.tone_map,
    }
    try:
        return msgspec.convert(given, Lighting)
    except msgspec.ValidationError as error:
        reason, _, field = str(error).rstrip("`").partition(" - at `$.")
        raise InputError(f"{field.replace('_', ' ')} {given.get(field)}: {reason}") from error


def _check(options: RenderOptions) -> None:
    if options.error_by_map and options.view == "base":
        raise InputError("--error-by-map: the view base shows one map alone; add --view lit, orm or another one")
    if not 0.0 <= options.opacity <= 1.0:
        raise InputError(f"--opacity {options.opacity}: must be 0 to 1")
    if options.out.exists() and not options.out.is_dir():
        raise InputError(f"--out {options.out}: is a file; name a folder")


def _opened(options: RenderOptions) -> Session:
    """Return a session with the scene, pack and view that the options name. Raises InputError."""
    pose = None if options.time is None else Pose(options.animation, options.time)
    scene = open_scene(options.scene, options.variant, pose)
    needs_packs = options.grouping is None or not is_image_source(options.grouping) or bool(options.pack)
    packs = packs_with(scene, options.pack, options.grouping) if needs_packs else {}
    source = choose_source(packs, options.grouping, options.pack)
    camera, lighting = choose_camera(scene, options), chosen_lighting(options)
    block_format = named_format(source)
    compressed = compress_scene(scene, block_format) if block_format is not None else None
    kind: OverlayKind = "divergence" if options.overlay == "divergence" else "none"
    overlay = Overlay(kind, options.opacity, options.palette, options.block, options.scale)
    view = ViewState(
        camera=camera,
        size=options.size,
        slot_a=Slot(source, options.path, filter=options.filter),
        overlay=overlay,
        anisotropy=options.anisotropy,
        material_view=options.view,
        lighting=lighting,
    )
    shown = {source: packs[source]} if source in packs else {}
    initial = InitialView(decoder_variant=options.decoder_variant)
    session = new_session(scene, shown, ViewerSettings(), initial)
    if compressed is not None:
        apply_event(session, TexturesCompressed(session.scene, compressed.block_format, compressed))
    apply_event(session, ViewChanged(view))
    return session


def render(options: RenderOptions) -> int:
    """Run `ntc-viewer render`. Raises InputError for bad input."""
    _check(options)
    session = _opened(options)
    source = session.view.slot_a.source
    context = create_headless_context(options.device)
    if options.require_gpu and context.info.is_software:
        raise InputError(f"--require-gpu: the renderer is {context.info.renderer}, a software rasteriser")
    with context.reset.watched():
        background = Background()
        drawing = WholeDrawing(context, session, background, lambda text: sys.stdout.write(f"{text}\n"))
        precision = resolve_precision(options.precision, session.packs.get(source), fastest_first(context))
        view = replace(session.view, slot_a=replace(session.view.slot_a, precision=precision))
        apply_event(session, ViewChanged(view))
        drawing.draw((-(-view.size[0] // WARM_UP_DIVISOR), -(-view.size[1] // WARM_UP_DIVISOR)))
        frame, renderer = drawing.draw(view.size)
        # Read first, because the calls below check whether the context was lost.
        shown = read_picture(frame.image)
        (measured,) = measure(renderer, [view.slot_a], session.packs, options.block)
        map_errors = errors_by_map(renderer, view.slot_a) if options.error_by_map else ()
        if options.aovs:
            write_aovs(options.out / "aovs.exr", material_aovs(renderer, view.slot_a))
        if frame.is_short:
            # Parts were drawn at coarser mips, so PSNR would be wrong.
            memory = "the GPU has no memory for the whole of it; choose a smaller --size, or close other programs"
            raise InputError(f"{source}: {frame.short_latents or memory}")
        background.close()
    stats = statistics(measured, frame, view, context.info.renderer)
    if map_errors:
        stats["error_by_map"] = map_error_statistics(map_errors, session.scene)
        write_map_errors(options.out, map_errors)
    compressed = session.compressed_as(source)
    if compressed is not None:
        stats["block_compression"] = compression_statistics(compressed)
    write_picture(options.out, measured, shown, stats, options.overlay, view.overlay)
    quality = stats["psnr_db"]
    sys.stdout.write(
        f"wrote {options.out}: {source}, camera {view.camera.name!r}"
        + (f", PSNR {quality:.2f} dB" if quality is not None else "")
        + f", excess {stats['divergence']['excess']}\n"
    )
    return 0
