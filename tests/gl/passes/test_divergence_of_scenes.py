"""The pass counts on real pictures what numpy counts from texture_id.npy: every camera, grouping and block shape."""

from pathlib import Path

import numpy as np
import pytest

from ntc.codec.config import GroupingConfig, GroupingName
from ntc.grouping import GroupingInputs, make_grouping
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from viewer.gl.context import GraphicsContext
from viewer.locations import assets_folder
from viewer.render.passes.divergence import DivergenceInputs, DivergencePass
from viewer.render.renderer import Renderer
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.cameras_file import read_cameras
from viewer.scene.load import load_scene
from viewer.scene.source_textures import source_textures
from viewer.state.view_state import BLOCKS, ViewState

NAMES: tuple[GroupingName, ...] = ("baseline", "single", "random", "category", "clustered", "covisible")
SIZES = ((640, 360), (331, 187))
"""The second is odd: blocks at the right and lower edge are partial."""


@pytest.mark.parametrize("place", ["courtyard", pytest.param("bistro", marks=(pytest.mark.once, pytest.mark.nightly))])
def test_every_camera_grouping_and_block_shape(
    graphics: GraphicsContext, place: str, request: pytest.FixtureRequest
) -> None:
    if place == "courtyard":
        path, cameras_file = assets_folder() / "courtyard.glb", assets_folder() / "courtyard.cameras.json"
    else:
        data: Path = request.getfixturevalue("data_folder")
        path, cameras_file = (data / "scenes" / "bistro" / name for name in ("bistro.gltf", "cameras.json"))
    scene, cameras = load_scene(path), read_cameras(cameras_file)
    renderer = Renderer(graphics, scene)
    stage: Stage = "compute" if graphics.features.compute else "fragment"
    counting = DivergencePass(graphics, scene_programs(graphics), stage)
    textures = source_textures(scene, 32)
    views = [renderer.texture_ids_from(camera, (320, 180)) for camera in cameras]
    groupings = [
        make_grouping(GroupingConfig(name, seed=3), textures, GroupingInputs(views=views)).groups for name in NAMES
    ]
    tables = DecoderTables(graphics, groupings)
    for size in SIZES:
        targets = [DivergenceTarget(graphics, size, block, len(NAMES)) for block in BLOCKS.values()]
        # Every viewpoint sees enough of the courtyard: some in each size.
        for camera in cameras if place == "bistro" else cameras[::3]:
            renderer.render(ViewState(camera, size))
            ids = renderer.texture_ids()
            assert (ids >= 0).any()
            for target in targets:
                counting.run(DivergenceInputs(renderer.visibility, 0, tables), target)
                for row, groups in enumerate(groupings):
                    decoders = np.array([*groups, -1], np.int32)[ids]
                    expected = divergence_map(decoders, target.block[::-1])
                    np.testing.assert_array_equal(target.read(row), expected)
                    counted, figures = target.statistics(row), DivergenceStatistics.of(expected)
                    assert (counted.excess, counted.maximum) == (figures.excess, figures.maximum)
        for target in targets:
            target.release()
    renderer.release()
