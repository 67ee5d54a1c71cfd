"""Tables, log, times and background work behind the panels, without a window."""

from dataclasses import replace

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.maps import MAPS
from ntc.codec.mips import mip_chain, mip_sizes
from ntc.codec.model import Grouping
from ntc.codec.quality import mse_of_psnr, psnr_db, psnr_of_mse
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.metrics.metrics import psnr_table
from tests.support.picture_scenes import Part, scene_of, texture
from tests.support.work import growth
from viewer.inspect.comparison import ErrorRow
from viewer.inspect.flat_texture import FlatTexture, decode_flat, visible_part
from viewer.inspect.frame_times import axis_top, beyond_text, frame_ticks
from viewer.inspect.group_table import centroid_distances, group_distances, group_rows, grouping_features
from viewer.inspect.memory_table import pack_memory, scene_memory, size_pairs, smaller_note
from viewer.inspect.scene_tree import SceneTree
from viewer.inspect.texture_table import TextureRow, filtered, ordered, texture_rows, with_error_shares
from viewer.jobs.job import JobReport
from viewer.render.frames import FRAMES, FrameHistory
from viewer.scene.model import Instances, Material, Scene
from viewer.state.message_log import LONGEST_LOG, MessageLog, details_of
from viewer.state.pack_files import match_scene
from viewer.ui.dock_layout import Place, column_width, titles_by_place
from viewer.ui.panels.groups import quality_text

WHITE = (1.0, 1.0, 1.0, 1.0)


def rows() -> list[TextureRow]:
    return [
        TextureRow(0, "Brick wall", 64, 64, "brick", 1, 30.0, 2.0),
        TextureRow(1, "roof", 128, 32, "brick", 0, None, 1.0),
        TextureRow(2, "brick floor", 8, 8, "", 1, 25.0, 4.0),
        TextureRow(3, "apple", 512, 512, "fruit", -1, None, None),
    ]


def test_filtering_asks_for_every_word_in_name_or_category() -> None:
    def ids(text: str) -> list[int]:
        return [row.texture_id for row in filtered(rows(), text)]

    assert ids("") == [0, 1, 2, 3]
    assert ids("BRICK") == [0, 1, 2]
    assert ids("brick floor") == [2]
    assert ids("group:1") == [0, 2]
    assert ids("group:1 wall") == [0]
    assert ids("pear") == []


def test_sorting_puts_unknown_values_last_both_ways() -> None:
    assert [row.texture_id for row in ordered(rows(), "mip 0 dB", False)] == [2, 0, 1, 3]
    assert [row.texture_id for row in ordered(rows(), "mip 0 dB", True)] == [0, 2, 1, 3]
    assert [row.texture_id for row in ordered(rows(), "name", False)] == [3, 2, 0, 1]
    assert [row.texture_id for row in ordered(rows(), "size", True)] == [3, 0, 1, 2]
    assert [row.texture_id for row in ordered(rows(), "group", False)] == [1, 0, 2, 3]


@pytest.fixture(scope="module")
def scene() -> Scene:
    textures = [texture(32, 32, seed) for seed in range(4)]
    return scene_of(
        [Part(material=number) for number in range(4)], [Material(f"m{n}", n, WHITE) for n in range(4)], textures
    )


def test_rows_say_what_the_pack_makes_of_a_texture(scene: Scene) -> None:
    hashes = [scene.textures[number].pixel_hash for number in (2, 0)]
    pack = random_pack(((32, 32), (16, 16)), (1, 0), hashes=hashes)
    found = texture_rows(scene, pack, match_scene(pack, scene), None)
    assert [row.group for row in found] == [0, -1, 1, -1]
    half, whole = found[0].bits_per_texel, found[2].bits_per_texel
    assert half is not None
    assert whole is not None
    assert whole == pytest.approx(psnr_table(pack).rows[0]["latent_bits_per_texel"])
    # Encoded at a quarter of the texels: bits are counted over those, as Measure and the terminal do.
    assert half == pytest.approx(psnr_table(pack).rows[1]["latent_bits_per_texel"])
    assert found[1].bits_per_texel is None


def test_shares_of_the_error_are_of_squares_and_sort(scene: Scene) -> None:
    errors = [ErrorRow(2, 0, 30, 20.0, 2.0, 1.0, 9), ErrorRow(0, 0, 10, 20.0, 2.0, 1.0, 9)]
    rows = with_error_shares(texture_rows(scene, None, None, None), errors)
    assert [row.error_share for row in rows] == [0.25, None, 0.75, None]
    assert [row.texture_id for row in ordered(rows, "error %", descending=True)] == [2, 0, 1, 3]


def test_originals_are_counted_with_all_their_maps() -> None:
    whole = replace(texture(8, 8), maps=MAPS)
    one = sum(side * side for side in (8, 4, 2, 1))
    plain, blocks = scene_memory(scene_of([], [], [whole]))
    # Base colour, normals, roughness with metalness and occlusion, emission.
    assert plain.bytes == 4 * 4 * one
    assert blocks.bytes == 4 * 16 * (4 + 1 + 1 + 1)


def test_memory_of_a_pack_adds_up(scene: Scene) -> None:
    pack = random_pack(((32, 32),), (0,), hashes=[scene.textures[1].pixel_hash])
    table = psnr_table(pack)
    found = {row.name: row for row in pack_memory(scene, pack, match_scene(pack, scene), {"latents": 10, "tables": 5})}
    assert found["pack in all"].bytes == table.latent_bytes + table.decoder_bytes + table.adapter_bytes
    assert found["GPU in all"].bytes == 15
    # Of the one texture that the pack holds, not of all four.
    one = scene_memory(scene)[0].bytes / 4
    assert found["GPU in all"].share == pytest.approx(15 / one)


def test_a_smaller_pack_is_compared_with_originals_of_its_size(scene: Scene) -> None:
    hashes = [scene.textures[number].pixel_hash for number in (0, 1)]
    pack = random_pack(((8, 8), (32, 32)), (0, 0), hashes=hashes)
    match = match_scene(pack, scene)
    found = {row.name: row for row in pack_memory(scene, pack, match, {"latents": 10}, idle=500)}
    same_size = 4 * sum(w * h for side in (8, 32) for w, h in mip_sizes(side, side))
    assert found["originals, that size"].bytes == same_size
    assert found["pack in all"].share == pytest.approx(found["pack in all"].bytes / same_size)
    assert (found["GPU in all"].bytes, found["for other paths"].bytes) == (10, 500)
    note = smaller_note(size_pairs(scene, pack, match))
    assert note == "1 of 2 textures encoded smaller than the originals, up to 8 x 8 of 32 x 32 texels"
    whole = random_pack(((32, 32),), (0,), hashes=hashes[:1])
    assert smaller_note(size_pairs(scene, whole, match_scene(whole, scene))) == ""


def test_distances_are_to_the_mean_of_the_group() -> None:
    features = np.array([[0.0, 0.0], [2.0, 0.0], [5.0, 5.0], [1.0, 3.0]])
    np.testing.assert_allclose(centroid_distances(features, np.array([0, 0, 1, 0])), [2**0.5, 2**0.5, 0.0, 2.0])


def test_groups_and_their_distances(scene: Scene) -> None:
    hashes = [item.pixel_hash for item in scene.textures]
    pack = random_pack(((32, 32),) * 4, (0, 1, 0, 0), hashes=[*hashes[:3], "elsewhere"])
    pack = replace(
        pack,
        textures=tuple(replace(item, psnr_db=30.0 + number) for number, item in enumerate(pack.textures)),
        grouping=Grouping("clustered", pack.grouping.groups, {"features": "low_level"}),
    )
    match = match_scene(pack, scene)
    first, second = group_rows(pack, match)
    assert (first.members, first.worst_db, first.absent, first.before_db) == ((0, 2), 30.0, 1, None)
    # Of the mean square error, as the training reports it: not the mean of 30 and 32.
    assert first.psnr_db == pytest.approx(psnr_of_mse((mse_of_psnr(30.0) + mse_of_psnr(32.0)) / 2))
    assert (second.members, second.absent) == ((1,), 0)
    older = replace(pack, textures=tuple(replace(item, psnr_db=25.0) for item in pack.textures))
    retrained = group_rows(pack, match, (older, match))
    assert [row.before_db for row in retrained] == [pytest.approx(25.0)] * 2
    assert quality_text(retrained[1]) == "PSNR of mip 0: 25.00 -> 31.00 dB"
    assert quality_text(replace(second, before_db=31.0)) == "PSNR of mip 0: 31.00 dB, as before"
    assert quality_text(second) == "PSNR of mip 0: 31.00 dB"
    unmeasured = replace(pack, textures=(replace(pack.textures[0], psnr_db=None), *pack.textures[1:]))
    assert group_rows(unmeasured, match)[0].psnr_db is None
    assert grouping_features(pack) == ("low_level", "")
    distances = group_distances(scene, match.decoders(pack), "low_level", "", JobReport()).by_texture
    assert set(distances) == {0, 1, 2}
    assert distances[1] == 0.0
    # Of two members the middle is equally far.
    assert distances[0] == pytest.approx(distances[2])
    assert distances[0] > 0.0


def test_a_flat_texture_is_what_the_reference_decoder_says(scene: Scene) -> None:
    pack = random_pack(((32, 32),), (0,), hashes=[scene.textures[3].pixel_hash])
    flat = decode_flat(scene.textures[3], pack, 0, JobReport())
    expected = decode_image(pack, 0)[..., :3]
    np.testing.assert_array_equal(flat.mips[0], expected)
    assert flat.psnr_db == pytest.approx(psnr_db(scene.textures[3].pixels, expected))
    assert not flat.reduced


def test_a_reduced_texture_is_compared_with_the_reduced_original(scene: Scene) -> None:
    pack = random_pack(((16, 16),), (0,), hashes=[scene.textures[3].pixel_hash])
    flat = decode_flat(scene.textures[3], pack, 0, JobReport())
    assert flat.mips[0].shape == (16, 16, 3)
    assert flat.reduced
    assert flat.psnr_db is not None


def test_a_large_texture_is_shown_coarse_first() -> None:
    large = texture(512, 300, 9)
    pack = random_pack(((512, 300),), (0,), hashes=[large.pixel_hash])
    report = JobReport()
    flat = decode_flat(large, pack, 0, report)
    assert isinstance(report.partial, FlatTexture)
    assert report.partial.level == 1
    assert report.partial.mips[0].shape == (150, 256, 3)
    assert flat.mips[0].shape == (300, 512, 3)


def test_the_log_keeps_the_last_thousand() -> None:
    log = MessageLog()
    for number in range(LONGEST_LOG + 5):
        log.add(f"message {number}", "message")
    assert len(log) == LONGEST_LOG
    assert log[0].text == "message 5"
    assert log.count == LONGEST_LOG + 5
    log.add(f"message {LONGEST_LOG + 4}", "message")
    assert len(log) == LONGEST_LOG
    assert log[-1].repeats == 2
    assert "(2 times)" in log.text()


def test_details_are_the_causes() -> None:
    error = InputError("a.glb: cannot be read")
    error.__cause__ = OSError("disk on fire")
    assert details_of(error) == "OSError: disk on fire"
    assert details_of(InputError("plain")) == ""


def test_times_of_the_last_frames() -> None:
    history = FrameHistory()
    for number in range(FRAMES + 10):
        history.add({"cull": float(number), **({"late": 1.0} if number > FRAMES else {})}, number + 0.5)
    assert len(history) == FRAMES
    assert history.wall_ms[[0, -1]].tolist() == [10.5, FRAMES + 9.5]
    assert history.passes_ms["cull"][0] == 10.0
    assert history.passes_ms["late"].sum() == 9.0


def test_the_axis_of_times_holds_the_recent_frames_and_the_usual_ones() -> None:
    cheap, heavy = np.full(250, 8.0), np.full(30, 300.0)
    # Most frames cost little: those that do not must fit all the same.
    assert axis_top(np.concatenate([cheap, heavy])) >= 300.0
    assert axis_top(np.concatenate([heavy, cheap])) >= 300.0
    compiling = np.concatenate([[5000.0], cheap])
    assert axis_top(compiling) < 20.0
    assert beyond_text(compiling, axis_top(compiling)) == "1 frame beyond the axis, up to 5,000 ms"
    assert beyond_text(cheap, axis_top(cheap)) == ""
    # What the medians below the plot are of is not cut off, but for a single frame that compiled shaders.
    assert axis_top(np.concatenate([cheap, [800.0]])) >= 800.0
    assert axis_top(np.concatenate([cheap, [5000.0, 4000.0]])) >= 5000.0
    assert axis_top(np.array([34000.0, 300.0, 200.0, 320.0])) < 500.0
    assert axis_top(np.zeros(0)) == 1.0


@pytest.mark.parametrize("frames", [2, 3, 4, 10, 16, 77, 300])
def test_frames_ago_are_whole_numbers(frames: int) -> None:
    ticks = frame_ticks(frames)
    assert ticks[-1] == 0
    assert len(ticks) in (2, 3, 4)
    assert all(0 <= tick < frames for tick in ticks)
    assert ticks == sorted(ticks, reverse=True)


def test_a_tree_of_many_instances_is_filtered_and_folded_quickly(scene: Scene) -> None:
    assert growth(lambda count: check_tree(scene, count), 10_000) < 50.0


def check_tree(scene: Scene, count: int) -> None:
    """Filter and fold a tree of `count` instances, two a node."""
    nodes = np.arange(count, dtype=np.int32) // 2
    instances = Instances(np.arange(count, dtype=np.int32) % 4, np.zeros((count, 4, 4), np.float32), nodes)
    large = replace(scene, instances=instances, node_names=tuple(f"node_{number}" for number in range(count // 2)))
    tree = SceneTree(large)
    assert len(tree) == count // 2
    assert tree[7].label == "node_7 (2)"
    tree.toggle(7)
    assert len(tree) == count // 2 + 2
    assert [(row.node, row.instance) for row in (tree[7], tree[8], tree[9], tree[10])] == [
        (7, -1),
        (7, 14),
        (7, 15),
        (8, -1),
    ]
    tree.filter("node_4999")
    assert tree.node_count == sum(name.startswith("node_4999") for name in large.node_names)
    tree.filter("m3")
    assert tree.node_count == count // 4


def test_places_by_the_size_of_the_window() -> None:
    places: dict[str, Place] = {"A": "upper", "B": "lower", "C": "upper"}
    assert titles_by_place(places, 720) == {"upper": ["A", "C"], "lower": ["B"]}
    assert titles_by_place(places, 400) == {"upper": ["A", "B", "C"]}
    assert column_width(1280) == 350
    assert column_width(640) == 340, "the picture keeps at least as much as it needs"
    assert column_width(320) == 160
    assert column_width(1800) == 396
    assert column_width(3840) == 440


def test_the_part_in_sight_is_no_larger_than_the_screen_needs() -> None:
    pixels = texture(512, 256, 4).pixels
    mips = tuple(mip_chain(pixels, "srgb"))
    whole = visible_part(mips, (0.0, 0.0, 1.0, 1.0), 128.0)
    assert whole is not None
    np.testing.assert_array_equal(whole.pixels, mips[2])
    assert whole.rectangle == (0.0, 0.0, 1.0, 1.0)
    assert visible_part(mips, (0.0, 0.0, 1.0, 1.0), 128.0, whole) is whole
    large = visible_part(mips, (0.5, 0.5, 0.515, 0.53), 10_240.0, whole)
    assert large is not None
    # Texels 256 to 264 and 128 to 136, and one more on each side, 20 times as large.
    assert large.pixels.shape == (20 * 10, 20 * 10, 3)
    np.testing.assert_array_equal(large.pixels[::20, ::20], pixels[127:137, 255:265])
    assert visible_part(mips, (1.5, 0.0, 2.0, 1.0), 128.0) is None
