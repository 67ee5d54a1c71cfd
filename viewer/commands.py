"""Every command of the window: one definition feeds keys, buttons, the help and README's key table."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from viewer.actions import SetCamera
from viewer.navigation import frame
from viewer.palettes import PALETTES
from viewer.session import Session
from viewer.settings import CameraMode
from viewer.view_state import BLOCKS, REFERENCE, CompareMode, OverlayKind, PathChoice
from viewer.zoom import WHOLE


@dataclass(frozen=True)
class Command:
    """Something the user can do."""

    name: str
    key: str
    """Name of the key as ImGui spells it; "" for none."""
    description: str
    run: Callable[[Session], None]


NEXT_MODE: dict[CompareMode, CompareMode] = {"a": "b", "b": "wipe", "wipe": "a"}
NEXT_PATH: dict[PathChoice, PathChoice] = {
    "auto": "deferred",
    "deferred": "binned",
    "binned": "cached",
    "cached": "forward",
    "forward": "deferred",
}
PICTURE_HINTS = (
    ("left drag", "orbit, or look round when flying"),
    ("right or middle drag", "pan"),
    ("wheel", "nearer, farther; speed when flying"),
    ("Ctrl + wheel", "look at the pixels themselves; Ctrl + drag moves them"),
    ("click", "with the heatmap: keep the block under the mouse in the panel Divergence"),
    ("W A S D Q E", "fly; Shift: faster"),
    ("drag the divider", "wipe between A and B; double-click recentres it"),
    ("drop a file", "open a .gltf, .glb or .ntc"),
)
"""What the mouse does, for the help."""


def _next_mode(session: Session) -> None:
    session.view = replace(session.view, compare=NEXT_MODE[session.view.compare])


def _next_path(session: Session) -> None:
    slot = session.view.slot_a
    if slot.source == REFERENCE:
        session.say("slot A shows the reference: it has no decode path")
        return
    session.view = replace(session.view, slot_a=replace(slot, path=NEXT_PATH[slot.path]))


def _next_source(session: Session) -> None:
    sources = session.sources
    slot = session.view.slot_a
    following = sources[(sources.index(slot.source) + 1) % len(sources)] if slot.source in sources else sources[0]
    session.view = replace(session.view, slot_a=replace(slot, source=following))


def _frame_all(session: Session) -> None:
    aspect = session.picture_size[0] / session.picture_size[1]
    session.apply(SetCamera(frame(session.view.camera, session.scene.bounds, aspect)))


def _next_camera(session: Session) -> None:
    cameras = session.scene.cameras
    if not cameras:
        session.say("the scene has no cameras")
        return
    names = [camera.name for camera in cameras]
    present = names.index(session.view.camera.name) if session.view.camera.name in names else -1
    session.apply(SetCamera(cameras[(present + 1) % len(cameras)]))


def _camera_mode(session: Session) -> None:
    mode: CameraMode = "fly" if session.settings.camera_mode == "orbit" else "orbit"
    session.settings = replace(session.settings, camera_mode=mode)
    session.say(f"camera: {mode}")


def _toggle_overlay(session: Session) -> None:
    overlay = session.view.overlay
    kind: OverlayKind = "none" if overlay.kind == "divergence" else "divergence"
    session.view = replace(session.view, overlay=replace(overlay, kind=kind))


def _next_block(session: Session) -> None:
    overlay = session.view.overlay
    names = tuple(BLOCKS)
    following = names[(names.index(overlay.block) + 1) % len(names)]
    session.view = replace(session.view, overlay=replace(overlay, block=following))
    session.say(f"decoders are counted in blocks of {following} pixels")


def _next_palette(session: Session) -> None:
    overlay = session.view.overlay
    names = tuple(PALETTES)
    following = names[(names.index(overlay.palette) + 1) % len(names)]
    session.view = replace(session.view, overlay=replace(overlay, palette=following))


def _whole_picture(session: Session) -> None:
    session.view = replace(session.view, zoom=WHOLE)


def _record_path(session: Session) -> None:
    if session.recording is None:
        session.recording = ()
        session.say("recording the camera's path; the same key ends it")
    else:
        session.recorded_path, session.recording = session.recording, None


def _toggle_panels(session: Session) -> None:
    session.show_panels = not session.show_panels


def _toggle_help(session: Session) -> None:
    session.show_help = not session.show_help


def _measure(session: Session) -> None:
    session.measure_requested = True


def _screenshot(session: Session) -> None:
    session.screenshot_requested = True


def _close(session: Session) -> None:
    if session.show_help:
        session.show_help = False
    else:
        session.closing = True


COMMANDS = (
    Command("next mode", "Tab", "show A, B, or both with a divider", _next_mode),
    Command("next source", "N", "show the next open pack in slot A", _next_source),
    Command("decode path", "P", "switch slot A to the next decode path: deferred, binned, cached, forward", _next_path),
    Command("divergence", "O", "lay the heatmap of decoders per block over the picture", _toggle_overlay),
    Command("block shape", "B", "count decoders in blocks of another shape: 8x8, 8x4, 16x4, 4x4", _next_block),
    Command("palette", "L", "colour the heatmap green to red, or fit for the colour-blind", _next_palette),
    Command("whole picture", "Z", "see the whole picture again after Ctrl + wheel", _whole_picture),
    Command("measure", "M", "measure PSNR, divergence and memory of both slots", _measure),
    Command("frame all", "F", "see the whole scene", _frame_all),
    Command("next camera", "C", "go to the scene's next camera", _next_camera),
    Command("camera mode", "V", "switch between orbiting and flying", _camera_mode),
    Command("record path", "R", "record the camera's path as a cameras file, until pressed again", _record_path),
    Command("screenshot", "F12", "write the window's content as a PNG", _screenshot),
    Command("panels", "H", "hide or show the panels", _toggle_panels),
    Command("help", "F1", "show keys and mouse", _toggle_help),
    Command("close", "Escape", "close the help, else the window", _close),
)
HOLD_KEY = "Space"
"""While held, the other slot is shown."""


def run_command(name: str, session: Session) -> None:
    """Run the command called `name`. Raises KeyError for a name that does not exist."""
    {command.name: command for command in COMMANDS}[name].run(session)


def key_table() -> tuple[tuple[str, str], ...]:
    """(key, what it does) of everything, keys first."""
    keys = tuple((command.key, command.description) for command in COMMANDS)
    return ((HOLD_KEY, "hold: show the other slot"), *keys, ("1 to 9", "go to a camera of the scene"), *PICTURE_HINTS)


def key_table_markdown() -> str:
    """The key table of README."""
    rows = [f"| {key} | {description} |" for key, description in key_table()]
    return "\n".join(["| key or mouse | what it does |", "|---|---|", *rows])
