"""The first minute: the card of first steps, the first view of a scene, and flying at a speed that fits the place."""

import time
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.support.gltf_builder import GltfBuilder, png
from tests.ui.conftest import Opener, run_window
from viewer.scene.load import load_scene
from viewer.scene.model import Camera
from viewer.state.framing import frame_all
from viewer.state.settings import SETTINGS_FILE, ViewerSettings, parse_settings
from viewer.ui.widgets import Area

CLOSED_AT_ONCE = "wait frames 3; expect label 'Got it'; click 'Got it'; wait frames 2; file.quit"


def settings(folder: Path) -> ViewerSettings:
    return parse_settings((folder / "settings" / SETTINGS_FILE).read_text(), SETTINGS_FILE)


@pytest.mark.process
def test_a_new_window_shows_the_card_until_it_is_closed(display: str, scene_path: Path, tmp_path: Path) -> None:
    command = ("-m", "viewer", "view", str(scene_path), "--exec")
    result = run_window(display, tmp_path, *command, CLOSED_AT_ONCE)
    assert result.returncode == 0, result.stderr
    assert not settings(tmp_path).first_steps
    # What is expected ends the script where it is not so: panels stay.
    script, ends = "wait frames 3; expect label 'Got it'; window.panels", {"NTC_VIEWER_EXIT_AFTER_FRAMES": "12"}
    run_window(display, tmp_path, *command, script, variables=ends)
    assert settings(tmp_path).show_panels


def shown_speed(app: DrivenApp) -> str:
    return next((label for label in app.widgets.labels() if label.startswith("flying")), "")


def hold(app: DrivenApp, key: imgui.Key, frames: int) -> float:
    """Distance that the eye moves while `key` is held."""
    before = np.array(app.session.view.camera.eye)
    app.key(key, True)
    app.frame(frames)
    app.key(key, False)
    return float(np.linalg.norm(np.array(app.session.view.camera.eye) - before))


def known(app: DrivenApp) -> None:
    """Fly until what is near is known."""
    hold(app, imgui.Key.w, 1)
    deadline = time.monotonic() + 20.0
    while app.frontend.interface.background.is_busy and time.monotonic() < deadline:
        time.sleep(0.01)


def test_flying_is_slower_near_a_surface(app: DrivenApp) -> None:
    known(app)
    far = hold(app, imgui.Key.w, 10)
    eye = app.session.view.camera.eye
    target = tuple(np.array(app.session.scene.bounds, np.float64).mean(axis=0).tolist())
    direction = np.array(target) - eye
    near = np.array(target) - direction / np.linalg.norm(direction) * 0.05
    app.run("camera.look", *near.tolist(), *target)
    assert hold(app, imgui.Key.w, 10) < 0.5 * far


def test_the_speed_is_shown_and_goes(app: DrivenApp, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not shown_speed(app)
    known(app)
    hold(app, imgui.Key.w, 2)
    assert shown_speed(app).endswith("units per second")
    start = time.monotonic()
    monkeypatch.setattr("viewer.ui.picture_input.time.monotonic", lambda: start + 10.0)
    app.settle()
    assert not shown_speed(app)


def test_letters_that_are_typed_do_not_fly(app: DrivenApp) -> None:
    before = app.session.view.camera
    app.run("file.open")
    app.settle()
    hold(app, imgui.Key.w, 3)
    assert app.session.view.camera == before


SHEETS = ("##offer", "##first steps")
WINDOWS = [
    (size, scale) for size in ((800, 500), (900, 600), (1280, 720), (1920, 1080), (3840, 2160)) for scale in (1, 2, 3)
]


def sheets(app: DrivenApp) -> dict[str, tuple[float, float, float, float]]:
    """Left, top, right and bottom of the sheets in sight, which lie in the picture, over nothing that is to be read."""
    area, found = app.frontend.interface.picture_area, {}
    for name in SHEETS:
        window = imgui.internal.find_window_by_name(name)
        if window is not None and window.active:
            box = window.rect()
            found[name] = (box.min.x, box.min.y, box.max.x, box.max.y)
            assert area is not None
            assert area.left <= box.min.x < box.max.x <= area.right
            assert area.top <= box.min.y < box.max.y <= area.bottom
    read = [label for label in app.widgets.labels() if label.startswith("warning ") or label == "hints"]
    boxes = {**found, **{label: app.widgets.rectangle(label) for label in read}}
    for name, one in found.items():
        for other, two in boxes.items():
            apart = one[2] <= two[0] or two[2] <= one[0] or one[3] <= two[1] or two[3] <= one[1]
            assert apart or name == other, (name, one, other, two)
    return found


@pytest.mark.parametrize(("size", "scale"), WINDOWS)
def test_sheets_lie_beside_warnings_and_hints(
    open_window: Opener, tmp_path: Path, size: tuple[int, int], scale: float
) -> None:
    app = open_window(size, load_scene(half_a_scene(tmp_path)), ui_scale=scale, live_figures=False)
    # A second warning.
    app.session.resolution = 0.25
    app.run("help.first-steps")
    searched(app)
    app.settle()
    wide, shown = size[0] / scale >= 1280, sheets(app)
    assert ("##offer" in shown) <= wide, "without room beside the card, one after the other"
    app.run("help.first-steps")
    app.settle()
    shown = sheets(app)
    assert "##first steps" not in shown
    assert "##offer" in shown or size[1] / scale < 300.0
    if size[1] / scale >= 360.0 and scale < 3:
        offer = imgui.internal.find_window_by_name("##offer")
        assert not offer.scrollbar_y, "all of it is seen"
    app.run("help.first-steps")
    app.settle()
    sheets(app)


def test_messages_lie_above_an_offer_in_a_lower_corner(
    app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    areas: list[Area] = []
    monkeypatch.setattr("viewer.ui.user_interface.draw_toasts", lambda _toasts, area: areas.append(area))
    app.resize((1280, 720))
    monkeypatch.setattr("viewer.ui.panels.training.OFFER_CORNERS", ((1, 1),))
    app.drop(half_a_scene(tmp_path))
    searched(app)
    app.settle()
    offer = imgui.internal.find_window_by_name("##offer").rect()
    assert "Encode it now" in app.widgets.labels()
    assert areas[-1].bottom <= offer.min.y
    app.click("Not now")
    app.settle()
    assert areas[-1].bottom > offer.min.y


def square(corner: tuple[float, float, float], right: tuple[float, ...], up: tuple[float, ...]) -> np.ndarray:
    """[6, 3] float32: two triangles, seen from the side to which right x up points."""
    a, u, v = (np.array(vector, np.float32) for vector in (corner, right, up))
    return np.array([a, a + u, a + u + v, a, a + u + v, a + v], np.float32)


def half_a_scene(folder: Path) -> Path:
    """Two squares, of which one's image is missing."""
    builder = GltfBuilder()
    uvs = square((0, 0, 0), (1, 0, 0), (0, 1, 0))[:, :2]
    pixels = np.random.default_rng(0).integers(0, 256, (8, 8, 3)).astype(np.uint8)
    images = (builder.image(png(pixels), name="there"), builder.add("images", uri="absent.png"))
    drawn = [
        builder.triangle(
            builder.material(image), POSITION=square((2.0 * number, 0, 0), (1, 0, 0), (0, 1, 0)), TEXCOORD_0=uvs
        )
        for number, image in enumerate(images)
    ]
    return builder.drawn(*drawn).write(folder / "part.glb")


def searched(app: DrivenApp) -> None:
    """Draw until the search has ended."""
    deadline = time.monotonic() + 60.0
    while app.session.seeks_first_view and time.monotonic() < deadline:
        app.frame()
    assert not app.session.seeks_first_view


def test_a_small_scene_is_seen_whole(app: DrivenApp, tmp_path: Path) -> None:
    app.drop(half_a_scene(tmp_path))
    searched(app)
    width, height = app.session.window.picture_size
    assert app.session.view.camera == frame_all(app.session.scene, app.session.settings.fov_degrees, width / height)


def room(folder: Path) -> Path:
    """A room of 8 x 3 x 5 m with a floor of one texture."""
    builder = GltfBuilder()
    uvs = square((0, 0, 0), (1, 0, 0), (0, 1, 0))[:, :2]
    floor = builder.material(
        builder.image(png(np.eye(8, dtype=np.uint8)[..., None] * np.full(3, 90, np.uint8)), name="floor"),
        doubleSided=True,
    )
    walls = builder.material(None, doubleSided=True)
    x, y, z = (8.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 5.0)
    origin = (0.0, 0.0, 0.0)
    sides = [
        (floor, origin, x, z),
        (walls, y, x, z),
        (walls, origin, x, y),
        (walls, z, x, y),
        (walls, origin, z, y),
        (walls, x, z, y),
    ]
    drawn = [builder.triangle(m, POSITION=square(at, u, v), TEXCOORD_0=uvs) for m, at, u, v in sides]
    return builder.drawn(*drawn).write(folder / "room.glb")


def test_in_a_room_one_stands_at_eye_height(app: DrivenApp, tmp_path: Path) -> None:
    app.drop(room(tmp_path))
    searched(app)
    camera = app.session.view.camera
    assert app.session.bookmarks["first view"] == camera
    assert camera.eye[1] == pytest.approx(1.7, abs=0.01)
    assert 0.0 < camera.eye[0] < 8.0
    assert 0.0 < camera.eye[2] < 5.0
    assert np.linalg.norm(np.array(camera.target) - camera.eye) > 2.5


def test_a_camera_that_was_moved_stays(app: DrivenApp, tmp_path: Path) -> None:
    app.open_files([room(tmp_path)])
    app.frame()
    app.run("camera.set", Camera("free", (0.0, 2.0, 0.0), (0.0, 2.0, -1.0)))
    searched(app)
    assert app.session.view.camera.eye == (0.0, 2.0, 0.0)
