"""Packs that events open, replace and close: what the session then has."""

from dataclasses import replace

import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.model import Pack
from tests.support.picture_scenes import Part, scene_of, texture
from viewer.scene.model import Material
from viewer.state.event_handlers import apply_event, expire_pointing, point_out
from viewer.state.events import PackClosed, PackUpdated, RunStarted
from viewer.state.open_files import InitialView, new_session
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import REFERENCE


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
    apply_event(session, RunStarted("run 1"))
    assert (session.view.slot_a.source, session.view.slot_b.source) == ("run 1", REFERENCE)
    apply_event(session, PackClosed("run 1"))
    assert session.view == before
    assert session.packs == {}


def test_a_run_is_shown_beside_what_b_shows(session: Session) -> None:
    apply_event(session, PackUpdated("run 1", pack(1)))
    apply_event(session, RunStarted("run 1"))
    session.view = replace(session.view, wipe_position=0.28).with_source("b", "run 1")
    apply_event(session, PackUpdated("run 2", pack(2)))
    apply_event(session, RunStarted("run 2"))
    assert (session.view.slot_a.source, session.view.slot_b.source) == ("run 2", "run 1")
    assert session.view.wipe_position == 0.5, "A was a sliver"
    session.view = replace(session.view, wipe_position=0.7, compare="b")
    apply_event(session, RunStarted("run 3"))
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
