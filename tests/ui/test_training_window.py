"""Training in the background of the window, without a window: a tiny scene, the real worker process."""

import hashlib
import os
import signal
import stat
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.encoding import BitsTarget
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import changed_groups
from tests.end_to_end.conftest import two_squares
from tests.support.driven_app import DrivenApp
from tests.support.training_workers import array_bytes, blocks
from viewer.commands import run_line
from viewer.scene.load import load_scene
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import REFERENCE
from viewer.training.live_training import LiveTraining

pytestmark = pytest.mark.process

SIZE = (900, 640)
PATIENCE = 140.0
"""Seconds that anything may take on a busy machine."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    two_squares(5).write(tmp_path / "scene.glb")
    return tmp_path


@pytest.fixture
def app(folder: Path) -> Iterator[DrivenApp]:
    made = DrivenApp(load_scene(folder / "scene.glb"), {}, SIZE, folder / "pictures")
    made.settle()
    yield made
    made.close()
    assert not blocks()


def wait(app: DrivenApp, done: Callable[[LiveTraining], object]) -> LiveTraining:
    training, began = app.training, time.monotonic()
    while not done(training):
        app.frame()
        assert time.monotonic() - began < PATIENCE, (training.state, messages(app))
        time.sleep(0.05)
    return training


def run(app: DrivenApp, line: str) -> LiveTraining:
    """Run a command that trains, to its end."""
    run_line(app.context, line)
    return wait(app, lambda training: training.active is None)


class PersonsApp(DrivenApp):
    """It prepares the encoding that it offers, as a window does."""

    prepares_ahead = True


@pytest.mark.parametrize("wanted", [True, False])
def test_the_encoding_that_is_offered_is_prepared(folder: Path, wanted: bool) -> None:
    settings = ViewerSettings(prepare_encoding=wanted)
    app = PersonsApp(load_scene(folder / "scene.glb"), {}, SIZE, folder / "pictures", settings)
    try:
        app.settle()
        began = time.monotonic()
        while wanted and app.training.process_id is None:
            app.frame()
            assert time.monotonic() - began < PATIENCE
        assert (app.training.process_id is not None) == wanted
        assert app.training.state == "idle"
        process = app.training.process_id
        app.click("Encode it now")
        wait(app, lambda training: training.active is None)
        assert not wanted or app.training.process_id == process
        assert app.training.log[1].outcome == "done"
        assert app.session.packs["run 1"].config.kind == "block"
        app.show_panel("Training")
        run_line(app.context, "training.discard")
        app.settle()
        app.click("prepare ahead")
        assert app.session.settings.prepare_encoding != wanted
    finally:
        app.close()
    assert not blocks()


def test_offer_panel_and_command_share_one_state(app: DrivenApp) -> None:
    plan = app.training.plan
    assert (plan.texture_size, plan.target, plan.strategy) == (None, None, "clustered")
    app.show_panel("Training")
    assert "forecast" in app.widgets.labels()
    app.double_click("bits")
    app.type("3")
    assert app.training.plan.target == BitsTarget(3.0)
    app.run("training.choose", "target", "25dB")
    app.run("training.choose", "textures", "1")
    app.settle()
    run(app, "training.encode baseline")
    pack = app.session.packs["run 1"]
    assert [texture.name for texture in pack.textures] == [app.session.scene.textures[1].name]
    assert (pack.textures[0].psnr_db or 0.0) >= 25.0, "settings of a quality are found while encoding"
    assert app.training.log.runs[-1].settings == "full size, block, 25 dB"


def test_a_drag_on_the_rate_curve_encodes_a_texture_anew(app: DrivenApp) -> None:
    """From a row to an answer, and from a place on the curve to a texture with so many bits."""
    run(app, "training.encode baseline auto full 1s best block 8")
    app.show_panel("Textures")
    app.click("texture 1")
    wait(app, lambda t: not t.rates.is_busy)
    app.settle()
    assert "bits, " in app.widgets.tips["rate answer"]
    sides = [0.8, 0.1]
    for number, side in enumerate(sides, 2):
        left, top, right, bottom = app.widgets.rectangle("rate curve")
        middle = (top + bottom) / 2.0
        app.drag((left + 0.5 * (right - left), middle), (left + side * (right - left), middle))
        wait(app, lambda t: t.active is None)
        assert len(app.training.log.runs) == number
        assert app.session.view.slot_a.source == f"run {number}"
        app.show_panel("Textures")
    first, more, fewer = (app.session.packs[f"run {number}"].textures for number in (1, 2, 3))
    assert first[0] is more[0] is fewer[0], "all other textures stay"
    assert (more[1].psnr_db or 0.0) > (fewer[1].psnr_db or 0.0), "fewer bits are kept although they are worse"
    assert app.training.log.runs[-1].title.startswith("picture 1 at ")


def test_quitting_while_encoding_asks_nothing(app: DrivenApp) -> None:
    run_line(app.context, "training.encode single auto 32 600s best grid")
    app.run("file.quit")
    assert app.is_closing


def messages(app: DrivenApp) -> str:
    return "\n".join(toast.text for toast in app.session.window.toasts)


def fingerprint(pack: Pack, group: int) -> str:
    members = tuple(texture for texture in pack.textures if texture.group == group)
    return hashlib.sha256(b"".join(array_bytes((pack.decoders[group], members)))).hexdigest()


def picture_at_rest(app: DrivenApp) -> np.ndarray:
    app.session.window.show_panels = False
    app.session.window.toasts = ()
    app.settle()
    shot = app.screenshot()
    app.session.window.show_panels = True
    app.settle()
    return shot


@pytest.mark.parametrize(
    ("codec", "budget"), [pytest.param("grid", "30steps", marks=pytest.mark.guards("training")), ("block", "1s")]
)
def test_encode_keep_retrain_discard(
    app: DrivenApp, folder: Path, monkeypatch: pytest.MonkeyPatch, codec: str, budget: str
) -> None:
    """The way of a user: the offer, the picture, the file, one group again, back; and the log of it."""
    session = app.session
    before = picture_at_rest(app)
    assert "Encode it now" in app.widgets.labels()
    app.show_panel("Training")
    app.click("bits")
    app.widgets.centre("Encode this scene")
    run_line(app.context, f"training.encode baseline auto 32 {budget}")
    app.settle()
    assert "Encode it now" not in app.widgets.labels()
    training = wait(app, lambda t: t.active is None or t.active.groups_seen)
    assert session.view.slot_a.source == "run 1"
    assert session.view.slot_b.source == REFERENCE
    training = wait(app, lambda t: t.active is None)
    assert [r.outcome for r in training.log.runs] == ["done"]
    assert training.log.chosen == 1
    assert training.curves is not None
    assert training.curves.seconds
    assert (picture_at_rest(app) != before).any()

    with pytest.raises(InputError, match=r"ends in \.ntc"):
        run_line(app.context, "training.keep pack.zip")
    (folder / "file").write_text("no folder")
    run_line(app.context, f"training.keep {folder / 'file' / 'pack.ntc'}")
    wait(app, lambda t: not t.saving)
    assert "cannot be written" in messages(app)
    assert training.log.chosen == 1
    if os.geteuid() != 0:  # root may write anywhere
        folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
        run_line(app.context, "training.keep")
        wait(app, lambda t: not t.saving)
        folder.chmod(stat.S_IRWXU)
        assert training.log.chosen == 1

    app.click("Keep")
    wait(app, lambda t: not t.saving)
    written = folder / "scene.baseline.ntc"
    assert str(written) in messages(app)
    first = read_pack(written)
    assert first.config.kind == codec
    assert [t.psnr_db for t in first.textures] == [t.psnr_db for t in session.packs["baseline"].textures]
    with pytest.raises(InputError, match="no unsaved run"):
        run_line(app.context, "training.discard")

    trains = codec == "grid"
    if trains:
        app.click("tab Retrain")
        app.click("group 1")
        assert "Retrain" in app.widgets.labels()
    else:
        with pytest.raises(InputError, match="not trained"):
            run_line(app.context, "training.retrain 1")
        with pytest.raises(InputError, match="encode the scene again"):
            run_line(app.context, "training.anew 1 500")
    uploads: list[tuple[str, Pack]] = []
    renderer = app.frontend.picture.renderer
    assert renderer is not None
    update_pack = renderer.update_pack

    shown = dict(session.packs)

    def record(name: str, pack: Pack) -> None:
        # The renderer leaves alone what it shows already.
        if shown.get(name) is not pack:
            uploads.append((name, pack))
        shown[name] = pack
        update_pack(name, pack)

    monkeypatch.setattr(renderer, "update_pack", record)
    most = codec_of(first.config).texture_bits(first.config, (first.textures[1].width, first.textures[1].height))
    run(app, f"training.retrain 1 {budget}" if most is None else f"training.anew 1 {most[1]:.3f}")
    assert {name for name, _ in uploads} == {"run 2"}
    assert all(changed_groups(before, after) <= {1} for (_, before), (_, after) in pairwise(uploads))
    old, new = session.packs["baseline"], session.packs["run 2"]
    assert fingerprint(old, 0) == fingerprint(new, 0)
    assert new.textures[0] is old.textures[0]
    assert (new.textures[1].psnr_db or 0.0) >= (old.textures[1].psnr_db or 0.0)
    assert (session.view.slot_a.source, session.view.slot_b.source) == ("run 2", REFERENCE), "B keeps what it shows"

    run_line(app.context, "training.discard")
    app.settle()
    assert session.view.slot_a.source == "baseline"
    assert "run 2" not in session.packs
    app.click("run 2 into B")
    assert session.view.slot_b.source == "run 2"
    assert [r.fate for r in training.log.runs] == ["done, kept", "done, discarded"]

    run(app, f"training.move 1 0 {budget}")
    assert session.packs["run 3"].grouping.groups == (0, 0)
    run(app, f"training.regroup baseline auto {budget}")
    assert session.packs["run 4"].grouping.groups == (0, 1)
    run_line(app.context, f"training.regroup baseline auto {budget}")
    wait(app, lambda t: t.active is None)
    assert "there is nothing to train" in messages(app)


def test_pause_resume_cancel_and_a_killed_process(app: DrivenApp) -> None:
    session = app.session
    run_line(app.context, "training.encode single auto 32 600s best grid")
    with pytest.raises(InputError, match="another run is under way"):
        run_line(app.context, "training.encode")
    training = wait(app, lambda t: t.active is not None and t.active.groups_seen)
    app.click("Pause")
    wait(app, lambda t: t.state == "paused")
    app.settle()
    active = training.active
    assert active is not None
    stood = active.progress
    app.frame(20)
    assert active.progress == stood
    app.click("Resume")
    wait(app, lambda t: active.progress != stood)
    app.click("Cancel")
    wait(app, lambda t: t.active is None)
    assert "was cancelled" in messages(app)
    assert training.log.runs[-1].outcome == "cancelled"
    assert session.view.slot_a.source == "run 1"
    run_line(app.context, "training.discard")
    app.settle()
    assert session.view.slot_a.source == REFERENCE
    assert not session.packs

    run_line(app.context, "training.encode single auto 32 600s best grid")
    wait(app, lambda t: t.active is not None and t.active.groups_seen)
    process = training.process_id
    assert process is not None
    os.kill(process, signal.SIGKILL)
    wait(app, lambda t: t.active is None)
    assert "killed by signal 9" in messages(app)
    assert session.view.slot_a.source == "run 2"
    assert training.log.runs[-1].outcome == "failed"
    assert training.log.runs[-1].pack is not None
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert not blocks()


def test_another_scene_ends_the_training(app: DrivenApp, folder: Path) -> None:
    other = two_squares(6).write(folder / "other.glb")
    run_line(app.context, "training.encode single auto 32 600s")
    app.drop(other)
    app.settle()
    assert "training was stopped because another scene was opened" in messages(app)
    training = app.training
    assert training.active is None
    assert app.session.scene.path == other
    assert not list(folder.glob("*.ntc"))
    assert app.session.view.slot_a.source == REFERENCE


REFUSED = [
    ("training.encode clustered 2 32 5", "budget"),
    ("training.encode clustered 2 32 0s", "above 0"),
    ("training.encode clustered many", "whole number"),
    ("training.encode clustered 2 1", "4 to"),
    ("training.encode clustered 2 32 5s best wavelet", "wavelet"),
    ("training.encode clustered 2 32 5s paper block", "recipe paper"),
    ("training.encode clustered 2 32 5s best block 0", "0.01 to"),
    ("training.choose target 70dB", "1 to 58.9"),
    ("training.choose textures few", "numbers of textures"),
    ("training.anew 0 4", "no pack"),
    ("training.retrain 0", "no pack"),
    ("training.regroup single", "no pack"),
    ("training.move 0 1", "no pack"),
    ("training.pause", "no training is under way"),
    ("training.cancel", "no training is under way"),
    ("training.keep", "no unsaved run"),
    ("training.show 3 a", "no such run"),
]


def test_what_cannot_be_is_said(app: DrivenApp) -> None:
    for line, message in REFUSED:
        with pytest.raises(InputError, match=message):
            run_line(app.context, line)


def test_the_status_bar_shows_a_run_and_cancels_it(app: DrivenApp) -> None:
    run_line(app.context, "training.encode category auto 32 60s paper")
    app.settle()
    assert "run 1: encode category" in app.widgets.tips["work"]
    place = app.widgets.centre("cancel work")
    wait(app, lambda t: t.active is None or t.active.progress)
    app.frame()
    assert " of " in app.widgets.tips["work"], "the phase with its count"
    assert app.widgets.centre("cancel work") == place, "a button stays where it is"
    app.click("cancel work")
    wait(app, lambda t: t.active is None)
    app.settle()
    assert "work" not in app.widgets.labels()
