"""A pack that replaces another one of the same textures: only what differs is uploaded, a budget a frame, and swapped whole."""

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import CodecSettings, Pack
from ntc.codec.registry import codec_of
from tests.gl.small_scenes import FRONT, INSIDE, objects
from tests.support.covering import covering
from viewer.gl.allocation import GpuMemory
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult, read_picture
from viewer.render.renderer import UPDATE_BYTES, Renderer
from viewer.scene.model import Camera
from viewer.state.view_state import DecodePath, Precision, Slot, ViewState

SIZE = (120, 72)
GROUPS = (0, 1, 0, 1)
ENCODED_SIZES = ((256, 256), (512, 256), (160, 96), (330, 330))
"""Larger than the scene's images: the latents of a group take more than one frame."""
MEMBERS = [1, 3]
ADAPTED = GridConfig(hidden_width=12, adapters=True, adapter_output=True, output_channels=4)
BLOCK = BlockConfig(block_words=(3,), mean_words=3.0, modes=8, coefficients=40)
BLOCK_SIZES = BlockConfig(block_words=(1, 3, 4), mean_words=3.0, modes=8, coefficients=40)
CODECS = {"plain": None, "adapted": ADAPTED, "block": BLOCK, "block, sizes": BLOCK_SIZES}
CACHED = Slot("p", "cached")
DEFERRED = Slot("p", "deferred")
ELSEWHERE = 1e-3
"""A tile on another page is sampled at other coordinates, which are rounded elsewhere."""
Picture = NDArray[np.float32]


def pack_of(seed: int, config: CodecSettings | None = None, groups: tuple[int, ...] = GROUPS) -> Pack:
    hashes = [texture.pixel_hash for texture in objects().textures]
    if isinstance(config, BlockConfig):
        return random_block_pack(ENCODED_SIZES, groups, config, hashes, seed=seed)
    assert config is None or isinstance(config, GridConfig)
    return random_pack(ENCODED_SIZES, groups, config, hashes, seed=seed)


def trained(old: Pack, seed: int = 5) -> Pack:
    """`old` with another group 1, as a training gives it: all else are the same objects."""
    other = pack_of(seed, old.config)
    textures = tuple(other.textures[i] if i in MEMBERS else texture for i, texture in enumerate(old.textures))
    return replace(old, textures=textures, decoders=(old.decoders[0], other.decoders[1]))


def opened(graphics: GraphicsContext, pack: Pack, update_bytes: int = UPDATE_BYTES) -> Renderer:
    made = Renderer(graphics, objects(), update_bytes=update_bytes)
    made.set_packs({"p": pack})
    return made


def draw(renderer: Renderer, slot: Slot = DEFERRED, camera: Camera = FRONT, whole: bool = False) -> FrameResult:
    return renderer.render(ViewState(camera, SIZE, slot), whole)


def fresh(graphics: GraphicsContext, pack: Pack, slot: Slot = DEFERRED, camera: Camera = FRONT) -> Picture:
    """What a renderer shows that never had another pack."""
    renderer = opened(graphics, pack)
    draw(renderer, slot, camera, whole=True)
    picture = renderer.picture(slot)
    renderer.release()
    return picture


def changed_bytes(renderer: Renderer, slot: Slot, pack: Pack) -> tuple[int, int]:
    """Bytes on the GPU of the changed group's latents, and of its decoder, adapters and records."""
    memory = renderer.memory(slot)
    assert memory is not None
    tables = codec_of(pack.config).gpu_tables(pack.config, slot.precision)
    weights = (tables.decoder_blocks + len(MEMBERS) * tables.adapter_blocks) * tables.block_bytes
    return int(memory.latents[MEMBERS].sum()), weights + len(MEMBERS) * tables.texture_record.itemsize


@pytest.mark.once
@pytest.mark.parametrize(
    ("codec", "precision", "path", "in_image"),
    covering(list(CODECS), ["fp32", "fp16"], ["forward", "deferred", "binned"], [False, True]),
)
def test_an_update_is_equal_to_a_fresh_upload(
    graphics: GraphicsContext, codec: str, precision: Precision, path: DecodePath, in_image: bool
) -> None:
    config = CODECS[codec]
    context = replace(graphics, features=replace(graphics.features, weights_in_image=in_image))
    slot = Slot("p", path, precision)
    old = pack_of(0, config)
    new = trained(old)
    renderer = opened(context, old)
    draw(renderer, slot)
    before = renderer.picture(slot)
    renderer.update_pack("p", new)
    frame = draw(renderer, slot)
    assert not frame.upload.is_pending
    assert frame.upload.uploaded > 0
    after = renderer.picture(slot)
    np.testing.assert_array_equal(after, fresh(context, new, slot))
    ids = renderer.texture_ids()
    np.testing.assert_array_equal(after[np.isin(ids, (0, 2))], before[np.isin(ids, (0, 2))])
    assert not np.array_equal(after, before)
    assert draw(renderer, slot).upload.uploaded == 0
    renderer.release()


@pytest.mark.parametrize("config", [None, ADAPTED, BLOCK], ids=["plain", "adapted", "block"])
def test_only_the_changed_group_is_uploaded_and_the_rest_is_kept(
    graphics: GraphicsContext, config: CodecSettings | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = pack_of(0, config)
    renderer = opened(graphics, old)
    draw(renderer)
    latents, others = changed_bytes(renderer, DEFERRED, old)
    memory = renderer.memory(DEFERRED)
    assert memory is not None
    written: list[int] = []
    for kind in (moderngl.Buffer, moderngl.Texture):
        write = kind.write

        def counted(made: object, data: bytes, *rest: object, write: Callable = write, **named: object) -> None:
            written.append(len(data))
            write(made, data, *rest, **named)

        monkeypatch.setattr(kind, "write", counted)
    renderer.update_pack("p", trained(old))
    upload = renderer._packs.advance_updates(UPDATE_BYTES)
    monkeypatch.undo()
    assert latents > 0
    assert sum(written) == upload.uploaded == latents + others
    unchanged = int(np.delete(memory.latents, MEMBERS).sum())
    assert unchanged < upload.unchanged < unchanged + memory.parts["decoders"]
    # A frame says the same.
    renderer.update_pack("p", old)
    frame = draw(renderer)
    assert frame.upload == upload
    assert frame.skipped["pack_bytes_kept"] == upload.unchanged
    renderer.release()


@pytest.mark.parametrize("path", ["forward", "deferred", "binned", "cached"])
def test_the_old_picture_is_shown_until_all_is_uploaded(graphics: GraphicsContext, path: DecodePath) -> None:
    old, budget, slot = pack_of(0), 24, Slot("p", path)
    new = trained(old)
    renderer = opened(graphics, old, budget)
    before = read_picture(draw(renderer, slot, whole=True).image)
    latents, others = changed_bytes(renderer, slot, old)
    assert latents > 4 * budget
    renderer.update_pack("p", new)
    uploaded, frames = [], 0
    while (frame := draw(renderer, slot)).upload.is_pending:
        frames += 1
        assert not frame.is_complete
        np.testing.assert_array_equal(read_picture(frame.image), before)
        uploaded.append(frame.upload.uploaded)
    assert frames >= latents // budget - 1
    assert max(uploaded) <= budget
    assert sum(uploaded) + frame.upload.uploaded >= latents + others
    draw(renderer, slot, whole=True)
    tolerance = ELSEWHERE if path == "cached" else 0.0
    np.testing.assert_allclose(renderer.picture(slot), fresh(graphics, new, slot), atol=tolerance, rtol=0.0)
    renderer.release()


def test_mips_that_come_into_sight_meanwhile_are_replaced_too(graphics: GraphicsContext) -> None:
    old, far = pack_of(0), replace(FRONT, eye=(15.0, 25.0, 70.0))
    new = trained(old)
    renderer = opened(graphics, old, 16)
    draw(renderer, camera=far)
    renderer.update_pack("p", new)
    assert draw(renderer, camera=far).upload.is_pending
    for camera in (FRONT, INSIDE):
        draw(renderer, camera=camera)
    np.testing.assert_array_equal(renderer.picture(DEFERRED), fresh(graphics, old, camera=INSIDE))
    while draw(renderer).upload.is_pending:
        pass
    np.testing.assert_array_equal(renderer.picture(DEFERRED), fresh(graphics, new))
    renderer.release()


def test_an_update_that_comes_meanwhile_follows(graphics: GraphicsContext) -> None:
    old = pack_of(0)
    second = trained(old, 6)
    third = replace(second, decoders=(pack_of(7).decoders[0], second.decoders[1]))
    renderer = opened(graphics, old, 60)
    draw(renderer)
    renderer.update_pack("p", trained(old))
    draw(renderer)
    renderer.update_pack("p", second)
    draw(renderer)
    renderer.update_pack("p", third)
    while draw(renderer).upload.is_pending:
        pass
    np.testing.assert_array_equal(renderer.picture(DEFERRED), fresh(graphics, third))
    renderer.release()


def test_unchanged_tiles_are_kept(graphics: GraphicsContext) -> None:
    old = pack_of(0)
    new = trained(old)
    renderer = opened(graphics, old, 60)
    decoded = draw(renderer, CACHED, whole=True).tiles[CACHED].decoded
    before, ids = renderer.picture(CACHED), renderer.texture_ids()
    renderer.update_pack("p", new)
    while not draw(renderer, CACHED).is_complete:
        pass
    anew = draw(renderer, CACHED).tiles[CACHED].decoded - decoded
    assert 0 < anew < decoded
    after, kept = renderer.picture(CACHED), np.isin(ids, (0, 2))
    np.testing.assert_array_equal(after[kept], before[kept])
    np.testing.assert_allclose(after, fresh(graphics, new, CACHED), atol=ELSEWHERE)
    renderer.release()


@pytest.mark.parametrize(
    ("path", "groups"),
    zip(
        ["forward", "deferred", "binned", "cached"],
        [(0, 0, 0, 0), (0, 1, 0, 2), (1, 0, 1, 0), (0, 1, 0, 2)],
        strict=True,
    ),
)
def test_textures_may_change_their_groups(graphics: GraphicsContext, groups: tuple[int, ...], path: DecodePath) -> None:
    old, new, slot = pack_of(0), pack_of(1, groups=groups), Slot("p", path)
    renderer = opened(graphics, old)
    draw(renderer, slot)
    renderer.update_pack("p", new)
    while not draw(renderer, slot).is_complete:
        pass
    tolerance = ELSEWHERE if path == "cached" else 0.0
    np.testing.assert_allclose(renderer.picture(slot), fresh(graphics, new, slot), atol=tolerance, rtol=0.0)
    renderer.release()


@pytest.mark.parametrize("path", ["forward", "deferred", "binned", "cached"])
def test_decoders_may_change_their_numbers(graphics: GraphicsContext, path: DecodePath) -> None:
    old, slot = pack_of(0), Slot("p", path)
    textures = tuple(replace(texture, group=1 - texture.group) for texture in old.textures)
    grouping = replace(old.grouping, groups=tuple(texture.group for texture in textures))
    new = replace(trained(old), grouping=grouping, decoders=old.decoders[::-1], textures=textures)
    renderer = opened(graphics, old)
    draw(renderer, slot)
    before = renderer.picture(slot)
    renderer.update_pack("p", new)
    while not draw(renderer, slot).is_complete:
        pass
    np.testing.assert_array_equal(renderer.picture(slot), before)
    # Another view reads the decoders anew.
    draw(renderer, slot, INSIDE, whole=True)
    tolerance = ELSEWHERE if path == "cached" else 0.0
    np.testing.assert_allclose(renderer.picture(slot), fresh(graphics, new, slot, INSIDE), atol=tolerance, rtol=0.0)
    renderer.release()


def test_other_sizes_or_codecs_are_uploaded_whole(graphics: GraphicsContext) -> None:
    old = pack_of(0)
    renderer = opened(graphics, old)
    draw(renderer)
    hashes = [texture.pixel_hash for texture in old.textures]
    for new in (random_pack([(32, 32)] * 4, GROUPS, hashes=hashes, seed=2), pack_of(3, ADAPTED)):
        renderer.update_pack("p", new)
        assert not draw(renderer).upload.is_pending
        np.testing.assert_array_equal(renderer.picture(DEFERRED), fresh(graphics, new))
    renderer.release()


def test_without_memory_beside_the_old_pack_the_new_one_is_uploaded_whole(graphics: GraphicsContext) -> None:
    class NothingBeside(GpuMemory):
        """No staging buffers."""

        def allows(self, what: str, size: int) -> bool:
            return what != "latents to be replaced"

    memory = NothingBeside(graphics.gl, 1 << 40)
    old = pack_of(0)
    new = trained(old)
    renderer = opened(replace(graphics, memory=memory), old, 60)
    draw(renderer)
    renderer.update_pack("p", new)
    assert not draw(renderer).upload.is_pending
    np.testing.assert_array_equal(renderer.picture(DEFERRED), fresh(graphics, new))
    renderer.release()
    assert memory.objects_given == 0


def test_both_precisions_of_a_pack_are_updated(graphics: GraphicsContext) -> None:
    old, half = pack_of(0), Slot("p", "deferred", "fp16")
    new = trained(old)
    renderer = opened(graphics, old, 60)
    view = ViewState(FRONT, SIZE, DEFERRED, half, compare="wipe")
    renderer.render(view)
    renderer.update_pack("p", new)
    while renderer.render(view).upload.is_pending:
        pass
    for slot in (DEFERRED, half):
        np.testing.assert_array_equal(renderer.picture(slot), fresh(graphics, new, slot))
    renderer.release()
