"""Path on-load: speed, memory and both losses of a scene, and its blocks beside those of offline encoders.

    python -m lab.benchmarks.on_load SCENE --pack F.ntc [--cameras cameras.json --camera NAME] [--json FILE]

Offline encoders are etcpak at its highest level (BC7, all partitions) and quicktex (BC5, BC4), of the extra `lab`. They and the
shaders compress the same decoded texels: the middle of mip 0, at most 512 x 512. BC4 and BC5 are read without rounding.
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.runner import chosen_cameras, machine, median, processor_ms, report, run, scene_options
from ntc.api import decode_maps
from ntc.codec.maps import MapName
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none, psnr_of_mse
from ntc.metrics.block_compression import decode_bc, encode_bc5, encode_bc7
from ntc.pack.file import read_pack
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.gl.texture_arrays import GpuBlockFormat
from viewer.inspect.measurement import measure
from viewer.render.passes.compress import ImageCompressor
from viewer.render.renderer import Renderer
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.navigation import turned
from viewer.state.view_state import REFERENCE, DecodePath, Slot, ViewState

SIDE = 512
"""Largest side in texels of what is compressed by all encoders."""
TEXTURES = 3
"""Most textures whose maps are compressed by all encoders."""
FORMATS: Mapping[int, GpuBlockFormat] = {1: "bc4", 2: "bc5", 3: "bc7", 4: "bc7"}
"""Format by the channels of a map."""
PATHS: tuple[DecodePath, ...] = ("deferred", "cached", "on-load")
Pixels = NDArray[np.uint8]


def _bc4_values(blocks: bytes, size: tuple[int, int], parts: int) -> NDArray[np.float64]:
    """[height, width, parts] of BC4 (1) or BC5 (2) blocks; sides are multiples of 4."""
    words = np.frombuffer(blocks, np.uint8).reshape(-1, 8).astype(np.int64)
    first, second = words[:, :1].astype(np.float64), words[:, 1:2].astype(np.float64)
    bits = (words[:, 2:] << (8 * np.arange(6))).sum(axis=1)
    codes = (bits[:, None] >> (3 * np.arange(16))) & 7
    is_eight = first > second
    last = np.where(is_eight, 7.0, 5.0)
    along = np.where(codes == 0, 0.0, np.where(codes == 1, last, codes - 1.0))
    found = first + (second - first) * along / last
    found = np.where(~is_eight & (codes == 6), 0.0, np.where(~is_eight & (codes == 7), 255.0, found))
    across, down = size[0] // 4, size[1] // 4
    return found.reshape(down, across, parts, 4, 4).transpose(0, 3, 1, 4, 2).reshape(size[1], size[0], parts)


def _read(blocks: bytes, size: tuple[int, int], block_format: GpuBlockFormat, channels: int) -> NDArray[np.float64]:
    if block_format == "bc7":
        return decode_bc(blocks, *size, 7)[..., :channels].astype(np.float64)
    return _bc4_values(blocks, size, channels)


def _offline(rgba: Pixels, block_format: GpuBlockFormat) -> bytes:
    if block_format == "bc7":
        return encode_bc7(rgba, "thorough")
    if block_format == "bc5":
        return encode_bc5(rgba)
    quicktex, bc4 = import_module("quicktex"), import_module("quicktex.s3tc.bc4")
    texture = quicktex.RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0])
    return bytes(bc4.BC4Encoder(0).encode(texture))


def _crops(pack: Pack) -> Iterator[tuple[str, MapName, Pixels]]:
    for number, texture in enumerate(pack.textures[:TEXTURES]):
        for name, pixels in decode_maps(pack, number).items():
            height, width = (min(SIDE, side // 4 * 4) for side in pixels.shape[:2])
            top, left = (pixels.shape[0] - height) // 2, (pixels.shape[1] - width) // 2
            crop = pixels[top : top + height, left : left + width]
            if height and width and pixels.shape[2] in FORMATS and np.ptp(crop) > 0:
                yield texture.name, name, np.ascontiguousarray(crop)


def compare_encoders(context: GraphicsContext, pack: Pack) -> list[dict[str, Any]]:
    """Return a row for each map of the first textures: PSNR of the shaders' blocks and of the offline encoder's, and speeds."""
    compressor, rows = ImageCompressor(context, scene_programs(context)), []
    for texture, name, pixels in _crops(pack):
        height, width, channels = pixels.shape
        block_format = FORMATS[channels]
        rgba = np.full((height, width, 4), 255, np.uint8)
        rgba[..., :channels] = pixels

        def quality(blocks: bytes, like: Pixels = pixels, own: GpuBlockFormat = block_format) -> float | None:
            read = _read(blocks, (like.shape[1], like.shape[0]), own, like.shape[2])
            return finite_or_none(psnr_of_mse(float(((read - like) ** 2).mean())))

        compressor.blocks(rgba, block_format)
        compress = partial(compressor.blocks, rgba, block_format)
        spent = min(processor_ms(compress, context.gl.finish) for _ in range(3))
        found = quality(compressor.blocks(rgba, block_format))
        start = time.process_time()
        blocks = _offline(rgba, block_format)
        offline_ms = 1e3 * (time.process_time() - start)
        best, texels = quality(blocks), width * height / 1e3
        rows.append(
            {
                "texture": texture,
                "map": name,
                "format": block_format,
                "shader dB": found,
                "offline dB": best,
                "difference dB": None if found is None or best is None else found - best,
                "shader Mtexel/s": texels / spent,
                "offline Mtexel/s": texels / offline_ms,
            }
        )
    return rows


def measure_scene(context: GraphicsContext, scene: Scene, pack: Pack, camera: Camera, options: Any) -> dict[str, Any]:
    """Return speed and memory of loading, both losses in the picture, and the time of a frame by path."""
    renderer = Renderer(context, scene)
    renderer.set_packs({"p": pack})
    view = ViewState(camera, options.size, material_view="lit")
    found: dict[str, Any] = {"camera": camera.name, "psnr_db": {}, "frame_ms": {}, "gpu_bytes": {}}
    for path in PATHS:
        slot = Slot("p", path)
        shown = replace(view, slot_a=slot)
        frame = renderer.render(shown, whole=True)
        if slot in frame.loads:
            found["load"] = frame.loads[slot].figures()
        picture = next(iter(measure(renderer, [slot], {"p": pack})))
        found["psnr_db"][path] = finite_or_none(picture.psnr_db(picture.covered))
        memory = renderer.memory(slot)
        found["gpu_bytes"][path] = None if memory is None else memory.total
        times = []
        for number in range(options.frames):
            moved = renderer.render(replace(shown, camera=turned(camera, 0.2 * (number + 1))), whole=True)
            times.append(moved.timings_ms.get(f"decode_{path}", 0.0))
        found["frame_ms"][path] = median(times)
    renderer.render(replace(view, slot_a=Slot(REFERENCE)), whole=True)
    renderer.release()
    return found


def main() -> None:
    """Print and write the table."""
    parser = scene_options(__doc__)
    parser.add_argument("--pack", type=Path, required=True)
    options = parser.parse_args()
    context, pack = create_headless_context(), read_pack(options.pack)
    scene = load_scene(options.scene)
    camera = chosen_cameras(scene, options.cameras, options.camera)[0]
    facts = {
        "scene": scene.name,
        "machine": machine(context),
        "size": list(options.size),
        "frames": options.frames,
        **measure_scene(context, scene, pack, camera, options),
    }
    report("blocks by compute shaders and by offline encoders", compare_encoders(context, pack), facts, options.json)


if __name__ == "__main__":
    run(main)
