"""`ntc-viewer render`: one picture without a window, with ids, divergence and statistics."""

import io
import json
import math
import sys
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import write_bytes, write_text
from ntc.metrics.block_compression import named_format
from ntc.metrics.compressed_textures import CompressedTextures
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from ntc.metrics.metrics import finite_or_none, psnr_db
from viewer.capture.aovs import material_aovs, write_aovs
from viewer.capture.overlay_picture import error_overlay, with_color_bar
from viewer.cli.map_errors import map_error_statistics, write_map_errors
from viewer.cli.options import RenderOptions
from viewer.cli.sources import choose_camera, choose_source, compress_scene, open_scene, packs_for, resolve_precision
from viewer.gl.context import create_headless_context
from viewer.inspect.map_errors import errors_by_map
from viewer.inspect.measurement import decoder_ids
from viewer.lighting.panorama import load_panorama
from viewer.render.back_ends import list_decoders
from viewer.render.frame_result import FrameResult, read_picture
from viewer.render.renderer import Renderer
from viewer.render.variants.choice import VariantChoice
from viewer.scene.images import write_png
from viewer.scene.model import Pose
from viewer.state.view_state import (
    BLOCKS,
    REFERENCE,
    SKY,
    Lighting,
    Overlay,
    OverlayKind,
    Slot,
    ViewState,
    is_image_source,
)

WARM_UP_DIVISOR = 16
"""A first frame this many times smaller compiles programs and uploads textures: `timings_ms` then holds drawing alone."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Outputs of one rendered frame. Row 0 is the top of the picture."""

    color: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB: what the view shows of the materials; maps have a black background."""
    reference: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB: the same from the original images."""
    covered: NDArray[np.bool_]
    """[H, W] where a surface is visible."""
    texture_ids: NDArray[np.int32]
    """[H, W] index into the scene's textures, -1 for none."""
    decoder_ids: NDArray[np.int32]
    """[H, W] group of the texture in the pack, -1 where nothing is decoded."""
    divergence: NDArray[np.uint16]
    """[ceil(H / block height), ceil(W / block width)] distinct decoders per block."""
    shown: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB: the picture with its overlay."""
    frame: FrameResult


def draw(renderer: Renderer, packs: dict[str, Pack], view: ViewState) -> Picture:
    """Draw slot A of `view` and its reference. Raises ContextLostError."""
    pack = packs.get(view.slot_a.source)
    frame = renderer.render(view, whole=True)
    # Read first: the calls below check whether the context was lost.
    shown = read_picture(frame.image)
    color = linear_to_srgb8(renderer.picture(view.slot_a))
    reference = color if view.slot_a.source == REFERENCE else linear_to_srgb8(renderer.picture(Slot(REFERENCE)))
    texture_ids = renderer.texture_ids()
    match = renderer.matches.get(view.slot_a.source)
    ids = np.full_like(texture_ids, -1)
    if pack is not None and match is not None:
        ids = decoder_ids(texture_ids, pack, match)
    width, height = BLOCKS[view.overlay.block]
    return Picture(
        color=color,
        reference=reference,
        covered=renderer.covered(),
        texture_ids=texture_ids,
        decoder_ids=ids,
        divergence=divergence_map(ids, (height, width)),
        shown=shown,
        frame=frame,
    )


def compression_statistics(compressed: CompressedTextures) -> dict[str, Any]:
    """What stats.json holds of textures in a format of graphics hardware: bytes and bits of all mips, PSNR of mip 0 in dB."""
    psnr = compressed.psnr
    summary = {name: finite_or_none(value) for name, value in vars(psnr).items()} if psnr is not None else None
    size = {"bytes": compressed.stored_bytes, "bits_per_texel": compressed.bits_per_texel}
    return {"format": compressed.block_format, "textures": len(compressed.textures), **size, "psnr_db": summary}


def statistics(picture: Picture, view: ViewState, renderer_name: str) -> dict[str, Any]:
    """What else stats.json holds. PSNR in dB over 8-bit sRGB RGB of the covered pixels; null for the reference itself,
    and where both pictures are equal.
    """
    divergence = DivergenceStatistics.of(picture.divergence)
    decoded = picture.decoder_ids >= 0
    is_reference, is_image = view.slot_a.source == REFERENCE, is_image_source(view.slot_a.source)

    def quality(mask: NDArray[np.bool_]) -> float | None:
        if is_reference or not mask.any():
            return None
        value = psnr_db(picture.color[mask], picture.reference[mask])
        # JSON has no infinity: equal pictures have no PSNR either.
        return value if math.isfinite(value) else None

    return {
        "renderer": renderer_name,
        "size": list(view.size),
        "grouping": view.slot_a.source,
        "path": None if is_image else picture.frame.paths[view.slot_a],
        "precision": None if is_image else view.slot_a.precision,
        "filter": None if is_image else "stochastic" if view.slot_a in picture.frame.samples else "exact",
        "samples": picture.frame.samples.get(view.slot_a, 1),
        "blend_samples": picture.frame.blend_samples.get(view.slot_a, 1),
        "camera": view.camera.name,
        "view": view.material_view,
        "lighting": asdict(view.lighting) if view.material_view == "lit" else None,
        "timer": picture.frame.timer,
        "timings_ms": picture.frame.timings_ms,
        "blocking_calls": picture.frame.blocking_calls,
        "pixels": {"covered": int(picture.covered.sum()), "decoded": int(decoded.sum())},
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
        "psnr_db": quality(picture.covered),
        "psnr_decoded_pixels_db": quality(decoded),
        "skipped": picture.frame.skipped,
        "tiles": {slot.path: asdict(counts) for slot, counts in picture.frame.tiles.items()},
    }


def _npy(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def write_picture(folder: Path, picture: Picture, stats: dict[str, Any], kind: str, overlay: Overlay) -> None:
    """Write the files of `render` into `folder`, stats.json last; `kind` is that of `overlay.png`, "none" for no such file."""
    write_png(folder / "color.png", picture.color)
    write_bytes(folder / "texture_id.npy", _npy(picture.texture_ids))
    write_bytes(folder / "decoder_id.npy", _npy(picture.decoder_ids))
    write_bytes(folder / "divergence.npy", _npy(picture.divergence))
    if kind == "divergence":
        most = overlay.most(int(picture.divergence.max(initial=0)))
        write_png(folder / "overlay.png", with_color_bar(picture.shown, overlay.palette, most))
    elif kind == "error":
        write_png(folder / "overlay.png", error_overlay(picture.color, picture.reference))
    write_text(folder / "stats.json", json.dumps(stats, indent=2, allow_nan=False) + "\n")


def chosen_lighting(options: RenderOptions) -> Lighting:
    """The light of --view lit. Raises InputError for values that are out of range, and for a panorama that cannot be used."""
    if options.environment is not None:
        # Whatever is wrong with the file is said before anything is drawn.
        load_panorama(options.environment)
    given: dict[str, Any] = {
        "environment": SKY if options.environment is None else str(options.environment),
        "sun_azimuth": options.sun[0] % 360.0 if math.isfinite(options.sun[0]) else options.sun[0],
        "sun_elevation": options.sun[1],
        "sun_strength": options.sun_strength
        if options.sun_strength is not None
        else float(options.environment is None),
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
    if options.decode_with not in (None, "glsl") and options.path not in ("cached", "binned"):
        raise InputError(f"--decode-with {options.decode_with}: only --path cached and binned have it")
    if options.out.exists() and not options.out.is_dir():
        raise InputError(f"--out {options.out}: is a file; name a folder")


def render(options: RenderOptions) -> int:
    """Run `ntc-viewer render`. Raises InputError for bad input."""
    _check(options)
    pose = None if options.time is None else Pose(options.animation, options.time)
    scene = open_scene(options.scene, options.variant, pose)
    if options.grouping is not None and is_image_source(options.grouping) and not options.pack:
        packs: dict[str, Pack] = {}
    else:
        packs = packs_for(scene, options.pack)
    source = choose_source(packs, options.grouping, options.pack)
    camera, lighting = choose_camera(scene, options), chosen_lighting(options)
    block_format = named_format(source)
    compressed = compress_scene(scene, block_format) if block_format is not None else None
    context = create_headless_context(options.device)
    if options.require_gpu and context.info.is_software:
        raise InputError(f"--require-gpu: the renderer is {context.info.renderer}, a software rasteriser")
    with context.reset.watched():
        variants = VariantChoice.of_environment(options.decoder_variant, print)
        renderer = Renderer(
            context, scene, list_decoders=list_decoders(options.decode_with or "glsl"), variants=variants
        )
        chosen = {source: packs[source]} if source in packs else {}
        if compressed is not None:
            renderer.images.set_compressed({compressed.block_format: compressed})
        renderer.set_packs(chosen)
        precision = resolve_precision(options.precision, chosen.get(source), partial(variants.precisions, context))
        slot = Slot(source, options.path, precision, options.filter)
        kind: OverlayKind = "divergence" if options.overlay == "divergence" else "none"
        overlay = Overlay(kind, options.opacity, options.palette, options.block, options.scale)
        view = ViewState(
            camera=camera,
            size=options.size,
            slot_a=slot,
            overlay=overlay,
            anisotropy=options.anisotropy,
            material_view=options.view,
            lighting=lighting,
        )
        renderer.render(replace(view, size=(-(-view.size[0] // WARM_UP_DIVISOR), -(-view.size[1] // WARM_UP_DIVISOR))))
        picture = draw(renderer, chosen, view)
        map_errors = errors_by_map(renderer, slot) if options.error_by_map else ()
        if options.aovs:
            write_aovs(options.out / "aovs.exr", material_aovs(renderer, slot))
        if picture.frame.is_short:
            # PSNR of a coarser picture would be a wrong number.
            memory = "the GPU has no memory for the whole of it; choose a smaller --size, or close other programs"
            raise InputError(f"{source}: {picture.frame.short_latents or memory}")
    stats = statistics(picture, view, context.info.renderer)
    if map_errors:
        stats["error_by_map"] = map_error_statistics(map_errors, scene)
        write_map_errors(options.out, map_errors)
    if compressed is not None:
        stats["block_compression"] = compression_statistics(compressed)
    write_picture(options.out, picture, stats, options.overlay, overlay)
    quality = stats["psnr_db"]
    sys.stdout.write(
        f"wrote {options.out}: {source}, camera {camera.name!r}"
        + (f", PSNR {quality:.2f} dB" if quality is not None else "")
        + f", excess {stats['divergence']['excess']}\n"
    )
    return 0
