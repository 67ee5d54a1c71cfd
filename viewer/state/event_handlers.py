"""Changes of the session by events of jobs and the renderer, and by the steps of a frame."""

from collections.abc import Mapping
from dataclasses import replace
from functools import singledispatch

from viewer.state import events
from viewer.state.events import Event
from viewer.state.framing import frame_all
from viewer.state.message_log import MessageKind
from viewer.state.session import PointedOut, PreviousView, Session, SlotMeasurement, Toast
from viewer.state.view_state import REFERENCE, Side, Slot, is_image_source

TOAST_SECONDS = 6.0
MOST_TOASTS = 5
NARROWEST_A = 0.4
"""Smallest share of the picture for slot A in which a training begins to show; below it the divider moves to the middle."""
POINTING_SECONDS = 2.5
"""Time for which a command highlights its textures, in seconds."""
LONGEST_PATH = 10_000
"""Largest number of cameras in a recorded path."""


def apply_event(session: Session, event: Event) -> None:
    """Change the session as `event` says."""
    _apply(event, session)


def notify(session: Session, text: str, kind: MessageKind = "message", details: str = "") -> None:
    """Show a message for a while, and keep it in the log with its details."""
    window = session.window
    window.log.add(text, kind, details)
    window.toasts = (*window.toasts[1 - MOST_TOASTS :], Toast(text, kind))


@singledispatch
def _apply(event: object, session: Session) -> None:
    raise TypeError(f"no handler for {event!r} of {session!r}")


@_apply.register
def _notification(event: events.Notification, session: Session) -> None:
    notify(session, event.text, event.kind, event.details)


@_apply.register
def _pack_updated(event: events.PackUpdated, session: Session) -> None:
    if session.packs.get(event.name) is not event.pack:
        session.packs = {**session.packs, event.name: event.pack}


@_apply.register
def _pack_closed(event: events.PackClosed, session: Session) -> None:
    packs = {name: pack for name, pack in session.packs.items() if name != event.name}
    view, previous = session.view, session.previous_views.get(event.name)
    if view.slot_a.source == event.name and previous is not None:
        view = replace(view, slot_a=previous.slot_a, slot_b=previous.slot_b, compare=previous.compare)
    for side, slot in view.slots.items():
        if slot.source not in (REFERENCE, *packs, *session.compressed):
            view = view.with_source(side, REFERENCE)
    session.view, session.packs = view, packs


@_apply.register
def _pack_renamed(event: events.PackRenamed, session: Session) -> None:
    old, new, packs = event.name, event.new_name, session.packs
    if old not in packs or new in packs:
        return
    session.packs = {new if name == old else name: pack for name, pack in packs.items()}
    for side, slot in session.view.slots.items():
        session.view = session.view.with_slot(side, _showing(slot, old, new))
    session.previous_views = {
        (new if name == old else name): PreviousView(
            _showing(before.slot_a, old, new), _showing(before.slot_b, old, new), before.compare
        )
        for name, before in session.previous_views.items()
    }


def _showing(slot: Slot, old: str, new: str) -> Slot:
    return replace(slot, source=new) if slot.source == old else slot


@_apply.register
def _pack_shown(event: events.PackShown, session: Session) -> None:
    view = session.view
    previous = PreviousView(view.slot_a, view.slot_b, view.compare)
    session.previous_views = {**session.previous_views, event.name: previous}
    path = "cached" if is_image_source(view.slot_a.source) else view.slot_a.path
    # Show what is trained, and beside it what it is compared with.
    alone = view.compare == "b" or (view.slot_a.source == REFERENCE and view.slot_b.source == REFERENCE)
    compare = "wipe" if alone else view.compare
    position = 0.5 if view.wipe_position < NARROWEST_A else view.wipe_position
    slot_a = replace(view.slot_a, source=event.name, path=path)
    session.view = replace(view, slot_a=slot_a, compare=compare, wipe_position=position)


@_apply.register
def _precision_chosen(event: events.PrecisionChosen, session: Session) -> None:
    session.precision_searches -= {event.side}
    if event.precision is not None:
        slot = replace(session.view.slots[event.side], precision=event.precision)
        session.view = session.view.with_slot(event.side, slot)


@_apply.register
def _textures_compressed(event: events.TexturesCompressed, session: Session) -> None:
    if event.scene is not session.scene:
        return
    waiting = session.awaited_formats
    sides = [side for side, block_format in waiting.items() if block_format == event.block_format]
    session.awaited_formats = {side: name for side, name in waiting.items() if side not in sides}
    if event.textures is None:
        return
    session.compressed = {**session.compressed, event.block_format: event.textures}
    for side in sides:
        session.view = session.view.with_source(side, event.block_format)


@_apply.register
def _view_changed(event: events.ViewChanged, session: Session) -> None:
    if event.view.pose != session.view.pose:
        # A pose that cannot be drawn ends the animation.
        session.playback = replace(session.playback, is_playing=False)
    session.view = event.view


@_apply.register
def _reverted(event: events.Reverted, session: Session) -> None:
    if event.scene is not session.scene:
        session.compressed, session.awaited_formats = {}, {}
    session.scene, session.packs, session.view = event.scene, event.packs, event.view
    for side, slot in session.view.slots.items():
        if slot.source not in session.open_sources:
            session.view = session.view.with_source(side, REFERENCE)
    inspection = session.inspection
    inspection.measurements, inspection.selected_texture, inspection.flat_texture = {}, None, None


@_apply.register
def _first_view_chosen(event: events.FirstViewChosen, session: Session) -> None:
    if event.scene is not session.scene:
        return
    session.seeks_first_view = False
    if event.camera is None:
        return
    session.view = replace(session.view, camera=event.camera)
    bookmarks = {**session.bookmarks, event.camera.name: event.camera}
    session.navigation.bookmarks = {**session.navigation.bookmarks, session.scene_key: bookmarks}
    notify(
        session,
        f"the camera is inside {session.scene.name}; F frames the whole scene, bookmark {event.camera.name!r} returns here",
    )


def start_frame(session: Session, seconds: float, picture_size: tuple[int, int]) -> None:
    """Begin a frame `seconds` after the last one; panels leave `picture_size` (width, height) pixels to the picture."""
    session.window.picture_size = picture_size
    if session.seeks_first_view:
        # It was framed before the room was known that panels leave.
        scene, fov = session.scene, session.settings.fov_degrees
        before, now = (frame_all(scene, fov, w / h) for w, h in (session.settings.window_size, picture_size))
        if session.view.camera == before != now:
            session.view = replace(session.view, camera=now)
    if session.navigation.motion is not None:
        moved = session.navigation.motion.advance(session.view.camera, session.scene.bounds, seconds)
        camera, session.navigation.motion = moved
        session.view = replace(session.view, camera=camera)
    if session.playback.is_playing and session.scene.animations:
        pose, session.playback = session.playback.advance(session.scene.animations, session.view.pose, seconds)
        session.view = replace(session.view, pose=pose)


def set_unsupported(session: Session, reasons: Mapping[str, str]) -> None:
    """Set the precisions and decode paths that this driver lacks, each with the reason."""
    session.unsupported = reasons


def set_panel_titles(session: Session, titles: tuple[str, ...]) -> None:
    """Set the titles of the window's panels."""
    session.window.panel_titles = titles


def set_flicker_phase(session: Session, shows_other: bool) -> None:
    """Set whether the flicker shows the other slot now."""
    session.window.flicker_phase = shows_other


def expire_toasts(session: Session, now: float) -> None:
    """Remove messages whose time on screen has ended; `now` is in monotonic seconds."""
    dated = (replace(toast, until=toast.until or now + TOAST_SECONDS) for toast in session.window.toasts)
    session.window.toasts = tuple(toast for toast in dated if toast.until is not None and toast.until > now)


def sample_camera(session: Session) -> None:
    """Add the camera to the path being recorded, where it has moved."""
    path = session.navigation.recording
    if path is None or len(path) >= LONGEST_PATH:
        return
    camera = replace(session.view.camera, name=f"path_{len(path) + 1:04d}")
    if not path or replace(path[-1], name=camera.name) != camera:
        session.navigation.recording = (*path, camera)


def point_out(session: Session, textures: tuple[int, ...], seconds: float = POINTING_SECONDS) -> None:
    """Dim everything but these textures (by id) for some seconds; an empty tuple ends that."""
    session.inspection.pointed_out = PointedOut(textures, seconds) if textures else None


def expire_pointing(session: Session, now: float) -> None:
    """End the highlight of `point_out` when its time is over; `now` is in monotonic seconds."""
    pointed = session.inspection.pointed_out
    if pointed is not None:
        until = pointed.until or now + pointed.seconds
        session.inspection.pointed_out = replace(pointed, until=until) if until > now else None


def set_measurements(session: Session, measurements: Mapping[Side, SlotMeasurement]) -> None:
    """Store the measurements of both slots in the present view, and tell the first ones."""
    if session.inspection.measured_view is not session.view:
        parts = [
            f"{side.upper()} {slot.source if slot.psnr_db is None else f'{slot.psnr_db:.2f} dB'}"
            for side, slot in measurements.items()
        ]
        notify(session, f"measured: {', '.join(parts)}; see panel Compare")
    session.inspection.measurements, session.inspection.measured_view = measurements, session.view
