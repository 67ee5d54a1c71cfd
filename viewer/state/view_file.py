"""Saved views as JSON, written by `view.save` and read by `view.load`."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from ntc.errors import InputError
from viewer.scene.cameras_file import Viewpoint
from viewer.scene.json_text import Share, Vector, convert, nonempty_line, parse_json, printable
from viewer.scene.model import AnimationFacts, Camera, Pose
from viewer.state.session import Session
from viewer.state.view_state import (
    LARGEST_ZOOM,
    REFERENCE,
    SKY,
    STUDIO,
    Anisotropy,
    CompareMode,
    Difference,
    Lighting,
    MaterialView,
    Overlay,
    Slot,
    ViewState,
    Zoom,
)

FORMAT = "ntc-viewer view"
VERSION = 1
LARGEST_VIEW = 1 << 20
"""Largest saved view in characters; a view has about a thousand, a bookmark 200."""
MOST_BOOKMARKS = 1000
SMALLEST_RESOLUTION = 0.05
REMEDY = "give what view.save or view.copy made"

Distance = Annotated[float, Meta(ge=1e-12, le=1e30)]


@dataclass(frozen=True)
class SavedView:
    """Saved view with the scene's name, resolution and bookmarks."""

    scene: str
    """Name of the scene that was open."""
    view: ViewState
    resolution: float
    """Resolution: drawn pixels along one side, as a share of the window's."""
    bookmarks: Mapping[str, Camera]


def present_view(session: Session) -> SavedView:
    """Return the current view of a session."""
    return SavedView(session.scene.name, session.view, session.resolution, session.bookmarks)


def _camera_fields(camera: Camera) -> dict[str, Any]:
    fields = {
        "name": camera.name,
        "eye": camera.eye,
        "target": camera.target,
        "up": camera.up,
        "fov": camera.fov_degrees,
        "orthographic_height": camera.orthographic_height,
        "near": camera.near,
        "far": camera.far,
    }
    return {name: value for name, value in fields.items() if value is not None}


def view_json(saved: SavedView) -> str:
    """Return a view as the JSON text that `parse_view` reads."""
    view = saved.view
    content = {
        "format": FORMAT,
        "version": VERSION,
        "scene": saved.scene,
        "camera": _camera_fields(view.camera),
        "slots": {"a": asdict(view.slot_a), "b": asdict(view.slot_b)},
        "compare": view.compare,
        "divider": view.wipe_position,
        "difference": asdict(view.difference),
        "overlay": asdict(view.overlay),
        "zoom": {"factor": view.zoom.factor, "x": view.zoom.centre[0], "y": view.zoom.centre[1]},
        "anisotropy": view.anisotropy,
        "materials": view.material_view,
        "lighting": asdict(view.lighting),
        "pose": None if view.pose is None else asdict(view.pose),
        "resolution": saved.resolution,
        "bookmarks": [_camera_fields(camera) for camera in saved.bookmarks.values()],
    }
    return json.dumps(content, indent=1) + "\n"


class _Camera(Viewpoint):
    up: Vector
    fov: Annotated[float, Meta(ge=1.0, le=179.0)]
    orthographic_height: Annotated[float, Meta(ge=1e-9, le=1e30)] | None = None
    near: Distance | None = None
    far: Distance | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.hypot(*self.up) == 0.0:
            raise ValueError("up must not be zero")
        if self.near is not None and self.far is not None and self.near >= self.far:
            raise ValueError("near must be less than far")

    def camera(self) -> Camera:
        return Camera(
            self.name, self.eye, self.target, self.up, self.fov, self.orthographic_height, self.near, self.far
        )


class _Slots(msgspec.Struct):
    a: Slot
    b: Slot

    def __post_init__(self) -> None:
        self.a, self.b = (replace(slot, source=nonempty_line(slot.source)) for slot in (self.a, self.b))


class _Zoom(msgspec.Struct):
    factor: Annotated[float, Meta(ge=1.0, le=LARGEST_ZOOM)]
    x: Annotated[float, Meta(ge=-1.0, le=2.0)]
    y: Annotated[float, Meta(ge=-1.0, le=2.0)]


class _Pose(msgspec.Struct):
    animation: str
    seconds: Annotated[float, Meta(ge=0.0, le=1e6)]


class _ViewFile(msgspec.Struct):
    version: Literal[1]
    scene: str
    slots: _Slots
    compare: CompareMode
    divider: Share
    difference: Difference
    overlay: Overlay
    zoom: _Zoom
    anisotropy: Anisotropy
    materials: MaterialView
    lighting: Lighting
    resolution: Annotated[float, Meta(ge=SMALLEST_RESOLUTION, le=1.0)]
    camera: _Camera | None = None
    pose: _Pose | None = None
    bookmarks: Annotated[list[_Camera], Meta(max_length=MOST_BOOKMARKS)] | None = None

    def __post_init__(self) -> None:
        self.scene = nonempty_line(self.scene)
        environment = printable(self.lighting.environment)
        if not environment:
            raise ValueError(f"lighting: the environment must be {SKY!r}, {STUDIO!r} or a file")
        self.lighting = replace(self.lighting, environment=environment)
        names = Counter(camera.name for camera in self.bookmarks or ())
        if len(names) < names.total():
            raise ValueError(f"bookmarks: two are called {names.most_common(1)[0][0]!r}")


def _merged(defaults: Any, given: Any) -> Any:
    """Return `given` with the fields that only `defaults` has, at every depth of JSON objects."""
    if not (isinstance(defaults, dict) and isinstance(given, dict)):
        return given
    return {**defaults, **{name: _merged(defaults.get(name), value) for name, value in given.items()}}


def parse_view(text: str, where: str, present: SavedView) -> SavedView:
    """Parse a view; absent fields are taken from `present`, unknown ones are ignored.

    `where` names the text in messages. Raises InputError in one line for text that is not a view and for values
    out of range. Sources are not checked.
    """
    if len(text) > LARGEST_VIEW:
        raise InputError(f"{where}: too long for a view ({len(text)} characters)")
    content = parse_json(text, where, REMEDY)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{where}: not a saved view (its format is not {FORMAT!r}); {REMEDY}")
    view = present.view
    defaults = json.loads(view_json(replace(present, bookmarks={})))
    camera = {name: defaults["camera"][name] for name in ("name", "eye", "target", "up", "fov")}
    del defaults["camera"], defaults["bookmarks"]
    merged = _merged(defaults, content)
    if "camera" in merged:
        merged["camera"] = _merged(camera, merged["camera"])
    if isinstance(merged.get("bookmarks"), list):
        del camera["name"]
        merged["bookmarks"] = [_merged(camera, bookmark) for bookmark in merged["bookmarks"]]
    saved = convert(merged, _ViewFile, where, REMEDY)
    return SavedView(
        saved.scene,
        replace(
            view,
            camera=view.camera if saved.camera is None else saved.camera.camera(),
            slot_a=saved.slots.a,
            slot_b=saved.slots.b,
            compare=saved.compare,
            wipe_position=saved.divider,
            difference=saved.difference,
            overlay=saved.overlay,
            zoom=Zoom(saved.zoom.factor, (saved.zoom.x, saved.zoom.y)),
            anisotropy=saved.anisotropy,
            material_view=saved.materials,
            lighting=saved.lighting,
            pose=None if saved.pose is None else Pose(printable(saved.pose.animation), saved.pose.seconds),
        ),
        saved.resolution,
        present.bookmarks
        if saved.bookmarks is None
        else {bookmark.name: bookmark.camera() for bookmark in saved.bookmarks},
    )


def with_open_sources(view: ViewState, present: ViewState, sources: tuple[str, ...]) -> tuple[ViewState, list[str]]:
    """Return `view` with slots of `present` in place of sources that are not open, and the names of those sources."""
    missing: dict[str, None] = {}
    for side, slot in view.slots.items():
        if slot.source not in (REFERENCE, *sources):
            missing[slot.source] = None
            view = view.with_slot(side, present.slots[side])
    return view, list(missing)


def with_known_pose(view: ViewState, animations: Sequence[AnimationFacts]) -> ViewState:
    """Return `view`, without its pose where that is of none of `animations`."""
    known = view.pose is None or any(animation.name == view.pose.animation for animation in animations)
    return view if known else replace(view, pose=None)
