"""The divergence pass counts what numpy counts."""

from collections.abc import Iterator

import numpy as np
import pytest

from ntc.divergence import divergence_map
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.passes.divergence import DecoderTable, DivergencePass, DivergenceTarget
from viewer.passes.layout import MATERIAL_SHIFT, scene_layout_glsl
from viewer.passes.visibility import SurfaceContent, VisibilityTarget
from viewer.resources import shaders_folder


@pytest.fixture(scope="module")
def context() -> Iterator[GraphicsContext]:
    made = create_headless_context()
    yield made
    made.gl.release()


@pytest.fixture(scope="module")
def counting(context: GraphicsContext) -> DivergencePass:
    library = ShaderLibrary(shaders_folder(), {"generated/layout.glsl": scene_layout_glsl()})
    return DivergencePass(context, ProgramFactory(context.gl, library))


def visibility_of(context: GraphicsContext, texture_ids: np.ndarray) -> VisibilityTarget:
    """A visibility buffer in which these texture ids [H, W], row 0 on top, are seen."""
    target = VisibilityTarget(context, texture_ids.shape[::-1], SurfaceContent(colors=False, gradients=False))
    words = np.zeros((*texture_ids.shape, 4), np.uint32)
    words[..., 0] = np.where(texture_ids < 0, 0, (texture_ids + 1) | (1 << MATERIAL_SHIFT))
    target.framebuffer.color_attachments[0].write(np.ascontiguousarray(words[::-1]).tobytes())
    return target


@pytest.mark.parametrize("block", [(8, 8), (8, 4), (16, 4), (4, 4)])
@pytest.mark.parametrize("size", [(64, 48), (33, 17), (1, 1), (131, 90)])
@pytest.mark.parametrize("decoders", [1, 5, 2000])
def test_it_equals_numpy(
    context: GraphicsContext, counting: DivergencePass, block: tuple[int, int], size: tuple[int, int], decoders: int
) -> None:
    random = np.random.default_rng(decoders)
    textures = 2500
    table = random.integers(0, decoders, textures)
    table[random.random(textures) < 0.1] = -1
    ids = random.integers(-1, textures, size[::-1])
    # Patches as well as noise.
    ids[: size[1] // 2] = ids[: size[1] // 2, :1]
    visibility = visibility_of(context, ids)
    target = DivergenceTarget(context, size, block)
    counting.run(visibility, DecoderTable(context, table.tolist()), target)
    expected = divergence_map(np.append(table, -1)[ids].astype(np.int32), (block[1], block[0]))
    np.testing.assert_array_equal(target.read(), expected)
    visibility.release()
    target.release()


def test_several_groupings_from_one_visibility_buffer(context: GraphicsContext, counting: DivergencePass) -> None:
    ids = np.random.default_rng(0).integers(-1, 40, (50, 70))
    visibility = visibility_of(context, ids)
    for groups in (1, 3, 40):
        table = [texture % groups for texture in range(40)]
        target = DivergenceTarget(context, (70, 50))
        counting.run(visibility, DecoderTable(context, table), target)
        np.testing.assert_array_equal(target.read(), divergence_map(np.append(table, -1)[ids].astype(np.int32)))
