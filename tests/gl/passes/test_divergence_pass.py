"""The divergence pass counts what numpy counts."""

import moderngl
import numpy as np
import pytest

from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from viewer.gl.context import GraphicsContext
from viewer.render.passes.divergence import DivergenceInputs, DivergencePass
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget
from viewer.render.resources.layout import MATERIAL_SHIFT
from viewer.render.resources.pack_buffers import scene_programs
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityTarget

pytestmark = pytest.mark.driver


@pytest.fixture(scope="module", params=[pytest.param("compute", marks=pytest.mark.computes), "fragment"])
def counting(graphics: GraphicsContext, request: pytest.FixtureRequest) -> DivergencePass:
    return DivergencePass(graphics, scene_programs(graphics), request.param)


def visibility_of(graphics: GraphicsContext, texture_ids: np.ndarray) -> VisibilityTarget:
    """A visibility buffer in which these texture ids [H, W], row 0 on top, are seen."""
    target = VisibilityTarget(graphics, texture_ids.shape[::-1], SurfaceContent(colors=False, gradients=False))
    words = np.zeros((*texture_ids.shape, 4), np.uint32)
    words[..., 0] = np.where(texture_ids < 0, 0, (texture_ids + 1) | (1 << MATERIAL_SHIFT))
    image = target.framebuffer.color_attachments[0]
    assert isinstance(image, moderngl.Texture)
    image.write(np.ascontiguousarray(words[::-1]).tobytes())
    return target


@pytest.mark.parametrize("block", [(8, 8), (8, 4), (16, 4), (4, 4)])
@pytest.mark.parametrize("size", [(33, 17), (1, 1), (131, 90)])
@pytest.mark.parametrize("decoders", [1, 5, 2000])
def test_it_equals_numpy(
    graphics: GraphicsContext, counting: DivergencePass, block: tuple[int, int], size: tuple[int, int], decoders: int
) -> None:
    random = np.random.default_rng(decoders)
    textures = 2500
    table = random.integers(0, decoders, textures)
    table[random.random(textures) < 0.1] = -1
    ids = random.integers(-1, textures, size[::-1])
    # Patches as well as noise.
    ids[: size[1] // 2] = ids[: size[1] // 2, :1]
    visibility = visibility_of(graphics, ids)
    target = DivergenceTarget(graphics, size, block)
    counting.run(DivergenceInputs(visibility, 0, DecoderTables(graphics, [table.tolist()])), target)
    expected = divergence_map(np.append(table, -1)[ids].astype(np.int32), (block[1], block[0]))
    np.testing.assert_array_equal(target.read(), expected)
    assert_equal_statistics(target.statistics(), DivergenceStatistics.of(expected))
    visibility.release()
    target.release()


def assert_equal_statistics(found: DivergenceStatistics, expected: DivergenceStatistics) -> None:
    longest = max(len(found.histogram), len(expected.histogram))
    padded = [(*figures.histogram, *(0,) * (longest - len(figures.histogram))) for figures in (found, expected)]
    assert padded[0] == padded[1]
    for name in ("score", "excess", "divergent_blocks", "maximum", "mean", "wave_efficiency"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name))


def test_several_groupings_at_once_from_one_visibility_buffer(
    graphics: GraphicsContext, counting: DivergencePass
) -> None:
    ids = np.random.default_rng(0).integers(-1, 40, (50, 70))
    visibility = visibility_of(graphics, ids)
    tables = [[texture % groups for texture in range(40)] for groups in (1, 3, 40)]
    target = DivergenceTarget(graphics, (70, 50), (8, 8), groupings=3)
    for _ in range(2):
        # Twice: nothing of the first count may be left in the second.
        counting.run(DivergenceInputs(visibility, 0, DecoderTables(graphics, tables)), target)
    for row, table in enumerate(tables):
        expected = divergence_map(np.append(table, -1)[ids].astype(np.int32))
        np.testing.assert_array_equal(target.read(row), expected)
        assert_equal_statistics(target.statistics(row), DivergenceStatistics.of(expected))


def test_nothing_seen_is_no_divergence(graphics: GraphicsContext, counting: DivergencePass) -> None:
    visibility = visibility_of(graphics, np.full((20, 20), -1))
    target = DivergenceTarget(graphics, (20, 20), (8, 8))
    counting.run(DivergenceInputs(visibility, 0, DecoderTables(graphics, [[]])), target)
    figures = target.statistics()
    assert (figures.excess, figures.maximum, figures.covered_blocks, figures.blocks) == (0, 0, 0, 9)
    assert (figures.score, figures.mean, figures.wave_efficiency) == (0.0, 0.0, 1.0)
