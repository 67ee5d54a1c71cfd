"""Animations, cameras, flying, the magnifying glass, colours of the divergence map, and packs that events bring."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.model import Pack
from tests.support.picture_scenes import Part, scene_of, texture
from viewer.capture.pictures import with_color_bar
from viewer.scene.model import AnimationFacts, Camera, Material, Pose
from viewer.state.camera import NEAREST_SHARE, clip_distances
from viewer.state.event_handlers import apply_event, expire_pointing, point_out
from viewer.state.events import PackClosed, PackShown, PackUpdated
from viewer.state.motion import PATH_SECONDS, AnimationPlayback, Playback, Turntable, chosen_animation
from viewer.state.navigation import FASTER_STEP, NEAR_SHARE, fly, fly_speed, kept_in_sight
from viewer.state.open_files import InitialView, new_session
from viewer.state.pack_files import preferred_source
from viewer.state.palettes import PALETTES, PaletteName, palette_colors, share_of_most
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings, with_last_pack
from viewer.state.view_state import LARGEST_ZOOM, REFERENCE, WHOLE, Zoom

ANIMATIONS = (AnimationFacts("walk", 2.0), AnimationFacts("wave", 0.5))


def test_time_goes_on_at_a_speed_and_begins_again() -> None:
    playing = AnimationPlayback(is_playing=True, speed=0.5)
    assert playing.advance(ANIMATIONS, None, 1.0) == (Pose("walk", 0.5), playing)
    pose, after = playing.advance(ANIMATIONS, Pose("walk", 1.9), 1.0)
    assert (pose.animation, after) == ("walk", playing)
    assert pose.seconds == pytest.approx(0.4)
    assert playing.advance(ANIMATIONS, Pose("wave", 0.1), 0.2)[0].seconds == pytest.approx(0.2 / 2 + 0.1)


def test_without_repeating_it_stops_at_the_end() -> None:
    playing = AnimationPlayback(is_playing=True, repeats=False)
    pose, after = playing.advance(ANIMATIONS, Pose("walk", 1.9), 1.0)
    assert pose == Pose("walk", 2.0)
    assert not after.is_playing
    pose, after = AnimationPlayback(is_playing=True).advance((AnimationFacts("still", 0.0),), None, 1.0)
    assert (pose, after.is_playing) == (Pose("still", 0.0), False)
    # An unknown name is the first animation.
    assert [chosen_animation(ANIMATIONS, Pose(name, 1.0)).name for name in ("run", "wave")] == ["walk", "wave"]


BOUNDS = np.array([[0, 0, 0], [2, 2, 4]], np.float32)
CAMERA = Camera("a", (1.0, 1.0, 7.0), (1.0, 1.0, 2.0), near=1.0, far=9.0)


def test_a_turntable_turns_about_the_centre() -> None:
    quarter, motion = Turntable(30.0).advance(CAMERA, BOUNDS, 3.0)
    assert motion == Turntable(30.0)
    np.testing.assert_allclose(quarter.eye, (6.0, 1.0, 2.0), atol=1e-9)
    np.testing.assert_allclose(quarter.target, (1.0, 1.0, 2.0), atol=1e-9)
    assert (quarter.near, quarter.far, quarter.name) == (None, None, "free")
    camera = CAMERA
    for _ in range(12 * 60):
        camera, _ = Turntable(-30.0).advance(camera, BOUNDS, 1.0 / 60.0)
    np.testing.assert_allclose(camera.eye, CAMERA.eye, atol=1e-9)


def test_a_path_is_played_to_its_end() -> None:
    cameras = tuple(replace(CAMERA, name=str(i), eye=(float(i), 0.0, 9.0)) for i in range(3))
    camera, motion = Playback(cameras).advance(CAMERA, BOUNDS, PATH_SECONDS / 2.0)
    assert camera.eye == pytest.approx((0.5, 0.0, 9.0))
    assert isinstance(motion, Playback)
    camera, motion = motion.advance(camera, BOUNDS, PATH_SECONDS)
    assert camera.eye == pytest.approx((1.5, 0.0, 9.0))
    assert motion is not None
    camera, motion = motion.advance(camera, BOUNDS, 100.0)
    assert (camera, motion) == (cameras[2], None)
    assert Playback(cameras[:1]).advance(CAMERA, BOUNDS, 0.0) == (cameras[0], None)


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        # In front of a box they are fitted to its corners; inside it the near one is a share of the far one.
        (Camera("out", (0.0, 0.0, 10.0), (0.0, 0.0, 0.0)), (7.92, 12.12)),
        (Camera("in", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), (2.02 * NEAREST_SHARE, 2.02)),
        (Camera("own", (0.0, 0.0, 10.0), (0.0, 0.0, 0.0), near=0.5, far=9.0), (0.5, 9.0)),
    ],
)
def test_near_and_far_are_those_of_the_camera_or_of_what_it_sees(camera: Camera, expected: tuple[float, float]) -> None:
    box = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]], np.float32)
    assert clip_distances(camera, box) == pytest.approx(expected)


TOWN = np.array([[-100.0, 0.0, -100.0], [100.0, 30.0, 100.0]], np.float32)
SIZE = float(np.linalg.norm(TOWN[1] - TOWN[0]))


@pytest.mark.parametrize(
    ("distance", "notches", "shift", "speed"),
    [
        (1.7, 0.0, False, NEAR_SHARE * 1.7),
        (3.4, 0.0, False, NEAR_SHARE * 3.4),
        # Walls slow down but are no end, and the sky has a limit.
        (0.0, 0.0, False, SIZE / 1000.0),
        (np.inf, 0.0, False, SIZE / 12.0),
        (2.0, 2.0, False, NEAR_SHARE * 2.0 * FASTER_STEP**2),
        (2.0, 0.0, True, NEAR_SHARE * 2.0 * 4.0),
    ],
)
def test_speed_is_that_of_what_is_near(distance: float, notches: float, shift: bool, speed: float) -> None:
    assert fly_speed(TOWN, distance, notches, shift) == pytest.approx(speed)


def test_flying_ends_far_from_the_scene_but_never_on_the_way_back() -> None:
    far = Camera("far", (0.0, 0.0, 1e4), (0.0, 0.0, 1e4 - 1.0))
    back, away = fly(far, (0.0, 0.0, 1.0), 5.0), fly(far, (0.0, 0.0, -1.0), 5.0)
    assert kept_in_sight(far, back, TOWN) == back
    assert kept_in_sight(far, away, TOWN) == far
    street = Camera("street", (0.0, 1.7, 0.0), (0.0, 1.7, -1.0))
    moved = fly(street, (0.0, 0.0, -1.0), 250.0)
    assert kept_in_sight(street, moved, TOWN) == moved


def test_places_of_the_window_and_the_picture() -> None:
    assert WHOLE.is_whole
    assert WHOLE.window_to_image(0.3, 0.8) == pytest.approx((0.3, 0.8))
    assert WHOLE.towards(0.5, 0.5, 1000.0).factor == LARGEST_ZOOM
    zoom = Zoom(3.0, (0.3, 0.7))
    place = zoom.window_to_image(0.1, 0.9)
    assert zoom.image_to_window(*place) == pytest.approx((0.1, 0.9))
    # Dragging moves the picture along.
    assert zoom.moved(0.1, -0.2).window_to_image(0.2, 0.7) == pytest.approx(place)


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.2, 0.9), (1.0, 1.0), (0.5, 0.5)])
def test_what_is_under_the_mouse_stays_there(at: tuple[float, float]) -> None:
    zoom = WHOLE
    for _ in range(6):
        larger = zoom.towards(*at, 1.0)
        assert larger.factor > zoom.factor
        assert larger.window_to_image(*at) == pytest.approx(zoom.window_to_image(*at))
        zoom = larger
    for _ in range(9):
        zoom = zoom.towards(*at, -1.0)
    assert zoom.is_whole
    assert zoom.corner == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize(("palette", "most"), zip(PALETTES, (2, 40), strict=True))
def test_the_bar_shows_every_number_in_its_colour(palette: PaletteName, most: int) -> None:
    picture = np.full((200, 500, 3), 90, np.uint8)
    drawn = with_color_bar(picture, palette, most)
    assert drawn.shape == picture.shape
    np.testing.assert_array_equal(drawn[:100], picture[:100])
    shares = np.array([share_of_most(decoders, most) for decoders in range(1, most + 1)])
    colors = {tuple(color) for color in np.rint(palette_colors(palette, shares) * 255.0).astype(int).tolist()}
    seen = {tuple(pixel) for pixel in drawn.reshape(-1, 3).astype(int).tolist()}
    assert colors <= seen
    # White digits below.
    assert (drawn == 255).all(axis=2).any() or (drawn.min(axis=2) > 200).any()


def pack(seed: int) -> Pack:
    return random_pack(((16, 16), (16, 16)), (0, 1), seed=seed)


@pytest.fixture
def session() -> Session:
    scene = scene_of([Part(material=0)], [Material("m", 0, (1.0, 1.0, 1.0, 1.0))], [texture(16, 16)])
    return new_session(scene, {}, ViewerSettings(), InitialView())


def test_a_pack_is_replaced_and_the_same_one_again_changes_nothing(session: Session) -> None:
    first, second = pack(1), pack(2)
    apply_event(session, PackUpdated("run 1", first))
    packs = session.packs
    apply_event(session, PackUpdated("run 1", first))
    assert session.packs is packs
    apply_event(session, PackUpdated("run 1", second))
    assert session.packs is not packs
    assert session.packs["run 1"] is second


def test_closing_a_run_shows_what_was_shown_before(session: Session) -> None:
    before = session.view
    apply_event(session, PackUpdated("run 1", pack(1)))
    apply_event(session, PackShown("run 1"))
    assert (session.view.slot_a.source, session.view.slot_b.source) == ("run 1", REFERENCE)
    apply_event(session, PackClosed("run 1"))
    assert session.view == before
    assert session.packs == {}


def test_a_run_is_shown_beside_what_b_shows(session: Session) -> None:
    apply_event(session, PackUpdated("run 1", pack(1)))
    apply_event(session, PackShown("run 1"))
    session.view = replace(session.view, wipe_position=0.28).with_source("b", "run 1")
    apply_event(session, PackUpdated("run 2", pack(2)))
    apply_event(session, PackShown("run 2"))
    assert (session.view.slot_a.source, session.view.slot_b.source) == ("run 2", "run 1")
    assert session.view.wipe_position == 0.5, "A was a sliver"
    session.view = replace(session.view, wipe_position=0.7, compare="b")
    apply_event(session, PackShown("run 3"))
    assert session.view.wipe_position == 0.7
    assert session.view.compare == "wipe"


def test_textures_are_pointed_out_for_a_while(session: Session) -> None:
    point_out(session, (0,), 2.0)
    assert session.shown_view.highlight == (0,)
    assert session.view.highlight == ()
    expire_pointing(session, 10.0)
    expire_pointing(session, 11.9)
    assert session.shown_view.highlight == (0,)
    expire_pointing(session, 12.1)
    assert session.shown_view.highlight == ()
    point_out(session, (5,))
    assert session.shown_view.highlight == (), "of another scene"


def test_the_pack_that_was_shown_last_is_remembered_and_shown_again(tmp_path: Path) -> None:
    scene = tmp_path / "scene.gltf"
    settings = with_last_pack(ViewerSettings(), scene, tmp_path / "scene.single.ntc")
    settings = with_last_pack(settings, scene, tmp_path / "scene.clustered-2.ntc")
    assert dict(settings.last_packs) == {str(scene): str(tmp_path / "scene.clustered-2.ntc")}
    packs = {
        name: replace(random_pack(), path=tmp_path / file)
        for name, file in (("clustered", "scene.clustered.ntc"), ("scene.clustered-2", "scene.clustered-2.ntc"))
    }
    assert preferred_source(packs) == "clustered"
    assert preferred_source(packs, settings.last_packs[str(scene)]) == "scene.clustered-2"
    assert preferred_source(packs, str(tmp_path / "gone.ntc")) == "clustered"
