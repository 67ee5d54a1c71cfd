"""How a scene is looked at, as JSON: what `view.save` writes and `view.load` reads."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, get_args

from ntc.errors import InputError
from viewer.scene.model import Camera
from viewer.state.json_fields import JsonFields
from viewer.state.palettes import PALETTES
from viewer.state.settings import ANISOTROPIES, GAIN_RANGE
from viewer.state.view_state import (
    BLOCKS,
    REFERENCE,
    CompareMode,
    Difference,
    DifferenceKind,
    Overlay,
    OverlayKind,
    PathChoice,
    Precision,
    Slot,
    ViewState,
)
from viewer.state.zoom import LARGEST, Zoom

if TYPE_CHECKING:
    from viewer.state.session import Session

FORMAT = "ntc-viewer view"
VERSION = 1
LARGEST_VIEW = 1 << 20
"""Bytes: a view is about a thousand, a bookmark 200."""
MOST_BOOKMARKS = 1000
SMALLEST_RESOLUTION = 0.05


@dataclass(frozen=True)
class SavedView:
    """What is saved of a view."""

    scene: str
    """Name of the scene it was made in."""
    view: ViewState
    resolution: float
    """Pixels of the picture along one side, as a share of the window's."""
    bookmarks: Mapping[str, Camera]


def present_view(session: "Session") -> SavedView:
    """What is seen in a session now."""
    return SavedView(session.scene.name, session.view, session.resolution, session.bookmarks)


def _camera_fields(camera: Camera) -> dict[str, Any]:
    return {
        "name": camera.name,
        "eye": camera.eye,
        "target": camera.target,
        "up": camera.up,
        "fov": camera.fov_degrees,
        **{
            name: value
            for name, value in (
                ("orthographic_height", camera.orthographic_height),
                ("near", camera.near),
                ("far", camera.far),
            )
            if value is not None
        },
    }


def view_json(saved: SavedView) -> str:
    """The text that `parse_view` reads back."""
    view = saved.view
    content = {
        "format": FORMAT,
        "version": VERSION,
        "scene": saved.scene,
        "camera": _camera_fields(view.camera),
        "slots": {
            side: {"source": slot.source, "path": slot.path, "precision": slot.precision}
            for side, slot in (("a", view.slot_a), ("b", view.slot_b))
        },
        "compare": view.compare,
        "divider": view.wipe_position,
        "difference": {"kind": view.difference.kind, "gain": view.difference.gain},
        "overlay": {
            "kind": view.overlay.kind,
            "opacity": view.overlay.opacity,
            "palette": view.overlay.palette,
            "block": view.overlay.block,
        },
        "zoom": {"factor": view.zoom.factor, "x": view.zoom.centre[0], "y": view.zoom.centre[1]},
        "anisotropy": view.anisotropy,
        "resolution": saved.resolution,
        "bookmarks": [_camera_fields(camera) for camera in saved.bookmarks.values()],
    }
    return json.dumps(content, indent=1) + "\n"


def _camera(fields: JsonFields, default: Camera, where: str) -> Camera:
    height = fields.number("orthographic_height", 0.0, 1e-9, 1e30) if "orthographic_height" in fields else None
    near = fields.number("near", 0.0, 1e-12, 1e30) if "near" in fields else None
    far = fields.number("far", 0.0, 1e-12, 1e30) if "far" in fields else None
    camera = Camera(
        fields.text("name", default.name),
        fields.vector("eye", default.eye),
        fields.vector("target", default.target),
        fields.vector("up", default.up),
        fields.number("fov", default.fov_degrees, 1.0, 179.0),
        height,
        near,
        far,
    )
    if math.dist(camera.eye, camera.target) == 0.0:
        raise InputError(f"{where}: eye and target are the same place; move one")
    if math.hypot(*camera.up) == 0.0:
        raise InputError(f"{where}.up: must point somewhere")
    if near is not None and far is not None and near >= far:
        raise InputError(f"{where}: near must be less than far")
    return camera


def _slot(fields: JsonFields, default: Slot) -> Slot:
    return Slot(
        fields.text("source", default.source),
        fields.choice("path", default.path, get_args(PathChoice)),
        fields.choice("precision", default.precision, get_args(Precision)),
    )


def _bookmarks(entries: tuple[JsonFields, ...], default: Camera, where: str) -> dict[str, Camera]:
    bookmarks: dict[str, Camera] = {}
    for index, entry in enumerate(entries):
        at = f"{where}.bookmarks[{index}]"
        camera = _camera(entry, replace(default, name=""), at)
        if not camera.name:
            raise InputError(f"{at}: lacks name")
        if camera.name in bookmarks:
            raise InputError(f"{at}.name: {camera.name!r} is there twice")
        bookmarks[camera.name] = camera
    return bookmarks


def parse_view(text: str, where: str, present: SavedView) -> SavedView:
    """The view that `text` describes; fields that are absent are as in `present`, unknown ones are ignored.

    `where` names the text in messages. Raises InputError, one line, for text that is no view and for values that are
    out of range. Whether its sources are open is not asked here.
    """
    if len(text) > LARGEST_VIEW:
        raise InputError(f"{where}: too long for a view ({len(text)} characters)")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not JSON ({error}); give what view.save or view.copy made") from error
    fields = JsonFields(content, where)
    if fields.choice("format", None, (FORMAT,)) is None:
        raise InputError(f"{where}: is no view: lacks format {FORMAT!r}")
    fields.choice("version", VERSION, (VERSION,))
    view = present.view
    slots, overlay, zoom = fields.object("slots"), fields.object("overlay"), fields.object("zoom")
    camera, difference = fields.object("camera"), fields.object("difference")
    seen = replace(
        view,
        camera=_camera(camera, replace(view.camera, near=None, far=None), f"{where}.camera")
        if "camera" in fields
        else view.camera,
        slot_a=_slot(slots.object("a"), view.slot_a),
        slot_b=_slot(slots.object("b"), view.slot_b),
        compare=fields.choice("compare", view.compare, get_args(CompareMode)),
        wipe_position=fields.number("divider", view.wipe_position, 0.0, 1.0),
        difference=Difference(
            difference.choice("kind", view.difference.kind, get_args(DifferenceKind)),
            difference.number("gain", view.difference.gain, *GAIN_RANGE),
        ),
        overlay=Overlay(
            overlay.choice("kind", view.overlay.kind, get_args(OverlayKind)),
            overlay.number("opacity", view.overlay.opacity, 0.0, 1.0),
            overlay.choice("palette", view.overlay.palette, tuple(PALETTES)),
            overlay.choice("block", view.overlay.block, tuple(BLOCKS)),
        ),
        zoom=Zoom(
            zoom.number("factor", view.zoom.factor, 1.0, LARGEST),
            (zoom.number("x", view.zoom.centre[0], -1.0, 2.0), zoom.number("y", view.zoom.centre[1], -1.0, 2.0)),
        ),
        anisotropy=fields.choice("anisotropy", view.anisotropy, ANISOTROPIES),
    )
    return SavedView(
        fields.text("scene", present.scene),
        seen,
        fields.number("resolution", present.resolution, SMALLEST_RESOLUTION, 1.0),
        _bookmarks(fields.objects("bookmarks", MOST_BOOKMARKS), view.camera, where)
        if "bookmarks" in fields
        else present.bookmarks,
    )


def with_open_sources(view: ViewState, present: ViewState, sources: tuple[str, ...]) -> tuple[ViewState, list[str]]:
    """`view` with the slots of `present` where a source is not open, and the names of those sources."""
    missing = list(
        dict.fromkeys(slot.source for slot in (view.slot_a, view.slot_b) if slot.source not in (REFERENCE, *sources))
    )
    return replace(
        view,
        slot_a=present.slot_a if view.slot_a.source in missing else view.slot_a,
        slot_b=present.slot_b if view.slot_b.source in missing else view.slot_b,
    ), missing
