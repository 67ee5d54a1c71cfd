"""What is not needed is not done. Decoded texels are counted by the shaders themselves, in a copy that counts them."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from tests.gl.small_scenes import FRONT, objects, pack_of
from tests.support.picture_scenes import WHITE, Part, cube, placed, scene_of, texture
from viewer.gl.context import GraphicsContext
from viewer.locations import shaders_folder
from viewer.render.renderer import Renderer
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.layout import StorageBinding
from viewer.scene.model import Camera, Material, Scene
from viewer.state.navigation import turned
from viewer.state.view_state import EXACT_PATHS, DecodePath, Overlay, Slot, ViewState

SIZE = (120, 72)
DIRECT: tuple[DecodePath, ...] = ("deferred", "forward", "binned")
COUNTER = 1 + max(StorageBinding)
"""Nothing uses this binding."""


@dataclass(frozen=True, eq=False)
class Work:
    """How many texels were decoded."""

    buffer: moderngl.Buffer

    def take(self) -> int:
        """Texels since the last call."""
        count = int(np.frombuffer(self.buffer.read(), np.uint32)[0])
        self.buffer.write(bytes(4))
        return count

    def bind(self) -> None:
        """Before each frame: the divergence pass has the binding too."""
        self.buffer.bind_to_storage_buffer(COUNTER)


@pytest.fixture
def work(graphics: GraphicsContext, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Work]:
    """Renderers made from now on count."""
    folder = tmp_path / "shaders"
    shutil.copytree(shaders_folder(), folder)
    file = folder / "ntc" / "grid.glsl"
    text, start = file.read_text(), "    lod = present_lod(record, lod);"
    assert text.count(start) == 1
    text = text.replace(start, "    atomicAdd(work_done, 1u);\n" + start)
    declared = f"layout(std430, binding = {COUNTER}) buffer Work {{ uint work_done; }};\n"
    file.write_text(text.replace("void decoder_input(", declared + "void decoder_input(", 1))
    monkeypatch.setattr("viewer.render.resources.pack_buffers.shaders_folder", lambda: folder)
    made = Work(graphics.gl.buffer(bytes(4)))
    yield made
    made.buffer.release()


def opened(
    graphics: GraphicsContext, scene: Scene, side: int | None = None, latents: LatentBudget | None = None
) -> Renderer:
    """The scene with its pack."""
    made = Renderer(graphics, scene, latents=latents)
    made.set_packs({"p": pack_of(scene, side)})
    return made


def view(path: DecodePath, camera: Camera = FRONT) -> ViewState:
    """Slot A by `path`, slot B the reference."""
    return ViewState(camera, SIZE, Slot("p", path))


@pytest.mark.parametrize("path", DIRECT)
@pytest.mark.computes
def test_only_visible_textured_pixels_are_decoded(graphics: GraphicsContext, work: Work, path: DecodePath) -> None:
    """Off-screen, back-facing and hidden surfaces, plain materials and the background cost nothing."""
    renderer = opened(graphics, objects())
    work.bind()
    renderer.render(view(path))
    seen = renderer.texture_ids() >= 0
    assert 0 < seen.sum() < seen.size
    decoded = work.take()
    # Triangles of one surface that meet at a pixel in the same depth are drawn both by the forward path.
    assert seen.sum() <= decoded <= seen.sum() * (1.005 if path == "forward" else 1.0)
    renderer.release()


@pytest.mark.parametrize("path", EXACT_PATHS)
@pytest.mark.computes
def test_what_does_not_concern_a_slot_does_not_decode_it_again(
    graphics: GraphicsContext, work: Work, path: DecodePath
) -> None:
    renderer = opened(graphics, objects())
    first = view(path)
    work.bind()
    renderer.render(first)
    assert work.take() > 0
    same = renderer.render(first)
    assert dict(same.timings_ms) == {}
    for other in (
        replace(first, overlay=Overlay("divergence")),
        replace(first, compare="wipe"),
        replace(first, compare="wipe", wipe_position=0.2),
        replace(first, compare="b"),
        first,
    ):
        work.bind()
        renderer.render(other)
        assert work.take() == 0, other
    renderer.release()


def apart() -> Scene:
    """Two cubes, one before the camera and one behind it, with textures of their own."""
    parts: list[Part] = [cube(0, placed(0.0, 0.0, -4.0)), cube(1, placed(0.0, 0.0, 4.0))]
    return scene_of(parts, [Material("m", index, WHITE) for index in (0, 1)], [texture(64, 64, 1), texture(64, 64, 2)])


AHEAD = Camera("ahead", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0))


@pytest.mark.parametrize("path", EXACT_PATHS)
def test_textures_out_of_sight_are_not_uploaded(graphics: GraphicsContext, path: DecodePath) -> None:
    renderer = opened(graphics, apart())
    frame = renderer.render(view(path, AHEAD))
    assert frame.skipped["latent_textures_not_uploaded"] == 1
    assert frame.skipped["latent_bytes_not_uploaded"] > 0
    both = renderer.render(view(path, turned(AHEAD, 180.0)))
    assert both.skipped["latent_textures_not_uploaded"] == 0
    renderer.release()


@pytest.mark.parametrize("path", EXACT_PATHS)
def test_only_the_mips_that_are_read_are_uploaded(graphics: GraphicsContext, path: DecodePath) -> None:
    scene = apart()
    far = replace(AHEAD, eye=(0.0, 0.0, 40.0), target=(0.0, 0.0, 39.0))
    renderer, complete = opened(graphics, scene, 256), opened(graphics, scene, 256)
    left_out = []
    for camera in (far, AHEAD, turned(AHEAD, 180.0), replace(AHEAD, eye=(0.0, 0.0, -2.99), fov_degrees=20.0), far):
        left_out.append(renderer.render(view(path, camera)).skipped["latent_bytes_not_uploaded"])
        # The other renderer has had everything on the GPU from the start.
        slot = Slot("p", path)
        complete.render(view(path, camera))
        on_gpu = complete._packs.on_gpu(slot)
        on_gpu.buffers.ensure_resident({0: 0, 1: 0})
        complete.render(view(path, turned(camera, 90.0)))
        complete.render(view(path, camera))
        np.testing.assert_array_equal(renderer.picture(slot), complete.picture(slot))
    assert sorted(left_out, reverse=True) == left_out
    # Without compute shaders nothing tells which mips are read.
    assert left_out[0] > left_out[1] or not graphics.features.compute
    for made in (renderer, complete):
        made.release()
