"""Whole frames of a pack of codec `block` by every path, against the float64 codec and against one another."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.filtering import decode_filtered
from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import block_parts
from ntc.codec.gpu import StoredRows, VariantName
from ntc.codec.mips import linear_to_srgb
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from tests.gl.render.test_frame_parity import CASES, SIZE, SIZES, TOLERANCE, renderer_of_cases
from tests.support.picture_scenes import WHITE, scene_of, straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.render.resources.latent_store import LatentBudget
from viewer.scene.model import Material, Sampler
from viewer.state.view_state import DecodePath, Slot, ViewState

CONFIG = BlockConfig(block_words=(2, 3, 6), mean_words=3.0, modes=8, coefficients=60)
VARIANTS: dict[str, VariantName] = {"alone": "software", "together": "gpu"}
"""Each pixel decodes its codes for itself, or work groups decode them together."""
GROUPINGS = {"two groups": (0, 1, 0), "one decoder": (0, 0, 0)}


@pytest.fixture(scope="module")
def packs() -> dict[str, Pack]:
    """One pack where pixels have different decoders, and one where they share one."""
    hashes = [texture(2 * w, 2 * h, w).pixel_hash for w, h in SIZES]
    return {name: random_block_pack(SIZES, groups, CONFIG, hashes) for name, groups in GROUPINGS.items()}


@pytest.fixture(scope="module", params=VARIANTS)
def renderer(request: pytest.FixtureRequest, graphics: GraphicsContext, packs: dict[str, Pack]) -> Iterator[Renderer]:
    made = renderer_of_cases(graphics, packs, VARIANTS[request.param])
    yield made
    made.release()


@pytest.mark.parametrize("path", ["deferred", "forward", "binned"])
@pytest.mark.parametrize("grouping", GROUPINGS)
@pytest.mark.parametrize("name", CASES)
def test_frames_agree_with_float64(
    renderer: Renderer, packs: dict[str, Pack], name: str, grouping: str, path: DecodePath
) -> None:
    case, slot = CASES[name], Slot(grouping, path)
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, slot))
    assert renderer.covered().all()
    shown = linear_to_srgb(renderer.picture(slot).astype(np.float64)).reshape(-1, 3)
    lod = np.full(SIZE[0] * SIZE[1], case.map.lod(SIZES[case.texture]))
    sampler = replace(case.sampler, wrap=case.wrap)
    expected = decode_filtered(packs[grouping], case.texture, case.map.uv(SIZE), lod, sampler)
    assert np.abs(shown - expected).max() <= TOLERANCE


def with_little_contrast(pack: Pack) -> Pack:
    """`pack` with textures whose values lie close together."""
    return replace(pack, textures=tuple(replace(t, axes=t.axes * np.float32(0.15)) for t in block_parts(pack).textures))


def latent_rows(pack: Pack, texture: int = 0) -> tuple[StoredRows, ...]:
    """Where each level of a texture lies."""
    return codec_of(pack.config).gpu_tables(pack.config).level_rows(pack.textures[texture])


@pytest.mark.parametrize("path", ["deferred", "forward", "binned", "cached"])
def test_mips_that_are_not_on_the_gpu_are_read_from_the_next_ones(graphics: GraphicsContext, path: DecodePath) -> None:
    case = CASES["magnified"]
    image = texture(*SIZES[0], 64)
    pack = random_block_pack(SIZES[:1], (0,), CONFIG, [image.pixel_hash])
    pack = with_little_contrast(pack)
    # Room for mip 2 and those below it: mips 0 and 1 are decoded from the same codes.
    budget = LatentBudget(sum(row.rows for row in latent_rows(pack)[2:]) * CONFIG.cell_bytes)
    renderer = Renderer(
        graphics, scene_of([case.map.quad(SIZE, 0, 0)], [Material("m", 0, WHITE)], [image]), latents=budget
    )
    renderer.set_packs({"p": pack})
    slot = Slot("p", path)
    renderer.render(ViewState(straight_camera(0), SIZE, slot), whole=True)
    memory = renderer.memory(slot)
    assert memory is not None
    assert memory.parts["latents"] == budget.budget_bytes
    shown = linear_to_srgb(renderer.picture(slot).astype(np.float64)).reshape(-1, 3)
    expected = decode_filtered(pack, 0, case.map.uv(SIZE), np.full(SIZE[0] * SIZE[1], 2.0), Sampler())
    # Tiles are resampled on the texels of the mip that is missing, and have 8 bits.
    assert np.abs(shown - expected).mean() <= (0.01 if path == "cached" else TOLERANCE)
    renderer.release()
