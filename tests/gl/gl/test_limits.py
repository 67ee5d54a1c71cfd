"""What a driver allows is asked of it: storage buffers, layers, textures. Too many work groups for one row lie in several."""

from dataclasses import replace

import pytest

from lab.bench.random_pack import square_pack
from ntc.codec.gpu import SOFTWARE
from ntc.codec.grid.model import GridConfig
from viewer.gl.allocation import GpuMemory, GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.limits import GROUPS_ACROSS, LARGEST_INT, Limits
from viewer.gl.texture_arrays import TileAtlas
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.pack_buffers import PackBuffers

CODEC = GridConfig(hidden_width=16)


@pytest.fixture
def small(graphics: GraphicsContext) -> GraphicsContext:
    """The context of a driver that lets shaders read 40,000 bytes of a buffer, and has arrays of two layers."""
    memory = GpuMemory(graphics.gl)
    memory.limits = replace(memory.limits, storage_block_bytes=40_000, array_layers=2)
    return replace(graphics, memory=memory)


def test_limits_beyond_32_bits_are_the_largest_number() -> None:
    names = ("GL_MAX_TEXTURE_SIZE", "GL_MAX_ARRAY_TEXTURE_LAYERS", "GL_MAX_UNIFORM_BLOCK_SIZE")
    info = {**dict.fromkeys(names, 2048), "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": -1}
    assert Limits.of(info).storage_block_bytes == LARGEST_INT


@pytest.mark.parametrize("groups", [0, 1, 65535, 65536, 65537, 131071, 2**24 + 1])
def test_rows_of_work_groups_hold_all_and_hardly_more(groups: int) -> None:
    for across in (GROUPS_ACROSS, 1000):
        limits = Limits.of({"GL_MAX_COMPUTE_WORK_GROUP_COUNT": (across, across, across)})
        width, height = limits.rows_of_work_groups(groups)
        assert width <= across
        assert 1 <= height <= GROUPS_ACROSS
        assert groups <= width * height < groups + height or groups == 0


def test_storage_buffers_larger_than_shaders_can_read_are_refused_in_one_line(small: GraphicsContext) -> None:
    small.memory.buffer("as large", reserve=40_000, storage=True).release()
    small.memory.buffer("not for shaders", reserve=50_000).release()
    with pytest.raises(GpuMemoryError, match=rf"list: .*{small.memory.limits.storage_limit}"):
        small.memory.buffer("list", reserve=40_004, storage=True)


def test_latents_keep_to_what_shaders_can_read(small: GraphicsContext) -> None:
    pack = square_pack(4, 1, 256, CODEC)
    buffers = PackBuffers(small, pack, range(4), "fp32", variant=SOFTWARE, on_demand=LatentBudget())
    buffers.ensure_resident(buffers.latent_store.all_levels())
    counts = buffers.latent_store.counts
    assert buffers.latent_store.buffer.size <= 40_000
    assert counts.levels_without_room > 0
    assert counts.out_of_memory, "the window tells of it"
    buffers.release()
    with pytest.raises(GpuMemoryError, match=rf"latents: .* \({small.memory.limits.storage_limit}\)"):
        PackBuffers(small, pack, range(4), "fp32", variant=SOFTWARE)


def test_a_tile_atlas_has_no_more_layers_than_the_driver_allows(small: GraphicsContext) -> None:
    atlas = TileAtlas(small, 64)
    assert atlas.grow(2)
    assert not atlas.grow(3)
    assert atlas.layers == 2
    atlas.release()
