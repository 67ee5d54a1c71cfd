"""Commands for files: open, export, screenshots, and the view as JSON in files and on the clipboard."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ntc.errors import InputError
from ntc.io import numbered_path, read_file
from ntc.library.index import is_library
from ntc.metrics.block_compression import BLOCK_FORMATS
from viewer.commands.command import Arg, Context, command, field_gesture, gesture
from viewer.commands.compare import show_source
from viewer.commands.effects import (
    CancelExport,
    Effect,
    Export,
    OpenScene,
    PictureKind,
    RunCommand,
    TakePicture,
    WriteText,
)
from viewer.commands.materials import use_environment
from viewer.export import EXPORT_NAMES, ExportKind, export_request
from viewer.export.images import missing_ktx2
from viewer.locations import is_builtin
from viewer.scene.scene_files import PACK_SUFFIX, PANORAMA_SUFFIXES
from viewer.state.event_handlers import notify
from viewer.state.open_files import open_pack
from viewer.state.pack_files import base_pack_name
from viewer.state.session import Session
from viewer.state.view_file import LARGEST_VIEW, parse_view, present_view, view_json, with_known_pose, with_open_sources
from viewer.state.view_state import LARGEST_ZOOM, PictureAlone, Zoom

PictureFile = Annotated[Path, Arg("a .png; a relative path is in the folder of pictures")]
Picture = Annotated[PictureAlone, Arg("content: shown, a, b, split (both with the divider) or plain (without overlay)")]


OpenedFile = Annotated[Path, Arg("a scene, a folder with one scene, a .ntc, .hdr or .exr; default: ask in a dialog")]


@command(
    "file.open", "Open...", "open a scene, a pack, or a panorama that lights the scene", "Ctrl+O", icon="folder-open"
)
def open_any(context: Context, file: OpenedFile = Path()) -> Effect | None:
    if file == Path():
        context.session.window.file_dialog = True
        return None
    if file.suffix.lower() in (PACK_SUFFIX, *PANORAMA_SUFFIXES) or is_library(file):
        return RunCommand("file.open-now", (file,), f"opening {file.name}")
    return OpenScene(file)


@gesture("file.open-now", "Open...")
def open_now(session: Session, file: Path) -> None:
    """Open a pack, a library or a panorama for the open scene."""
    if file.suffix.lower() in PANORAMA_SUFFIXES:
        use_environment(session, file)
        session.view = replace(session.view, material_view="lit")
    else:
        open_pack(session, file)
    session.window.file_dialog = False


def _exported_pack(session: Session) -> tuple[str, Path]:
    """Return name and file of the exported pack: slot A's, else slot B's. Raises InputError where there is no pack in a file."""
    name = base_pack_name(session.view, session.packs)
    if name is None:
        raise InputError("no pack is open; encode the scene first (training.encode)")
    path = session.packs[name].path
    if path is None:
        raise InputError(f"{name} is not in a file; keep the run first (training.keep)")
    return name, path


def _not_exportable(context: Context) -> str:
    if context.session.scene.path is None:
        return "the scene was not read from a file"
    try:
        _exported_pack(context.session)
    except InputError as error:
        return str(error)
    return ""


ExportFolder = Annotated[Path, Arg("folder to write into; default: a new one beside the scene")]


@command(
    "file.export",
    "Export",
    "write the scene with its pack for other programs: glTF, glTF with KTX2 or BC7 images, a web page, or the decoder's source",
    unavailable=_not_exportable,
    icon="file-export",
)
def export(
    session: Session,
    kind: Annotated[
        ExportKind,
        Arg(
            "what to write: glTF with pack or images, a page, or a language",
            names=EXPORT_NAMES,
            refuses=lambda _session, kind: missing_ktx2() if kind == "gltf-ktx2" else "",
        ),
    ],
    folder: ExportFolder = Path(),
) -> Effect:
    scene = session.scene.path
    assert scene is not None
    name, pack = _exported_pack(session)
    if folder == Path():
        parent = session.pictures_folder if is_builtin(scene) else scene.parent
        folder = numbered_path(parent / f"{session.scene.title}-{kind}")
    folder = folder.absolute()
    if kind.startswith("gltf"):
        folder.mkdir(parents=True, exist_ok=True)
    request = export_request(kind, scene.absolute(), pack.absolute(), folder)
    return Export(f"exporting {name} as {EXPORT_NAMES[kind]}", request, folder)


cancel_export = gesture("file.cancel-export")(lambda _session: CancelExport())
RecentFile = Annotated[str, Arg("a recent file", lambda session: session.settings.recent_files)]


@command("file.open-recent", "Open recent", "open a scene or a pack that was opened before", icon="clock-rotate-left")
def open_recent(_session: Session, file: RecentFile) -> Effect:
    return RunCommand("file.open", (Path(file),))


def _picture(kind: PictureKind, file: Path) -> Effect:
    if file != Path() and file.suffix.lower() != ".png":
        raise InputError(f"{file}: the name of a picture must end in .png")
    return TakePicture(kind, None if file == Path() else file)


@command("file.screenshot", "Screenshot", "save the window as a PNG", "F12", icon="camera")
def take_screenshot(_session: Session, file: PictureFile = Path()) -> Effect:
    return _picture("window", file)


@command("file.screenshot-picture", "Save picture only", "save the picture without panels as a PNG", icon="image")
def take_picture(_session: Session, kind: Picture, file: PictureFile = Path()) -> Effect:
    return _picture(kind, file)


def _restore(session: Session, text: str, where: str) -> None:
    saved = parse_view(text, where, present_view(session))
    view, missing = with_open_sources(saved.view, session.view, session.open_sources)
    session.navigation.motion = None
    session.playback = replace(session.playback, is_playing=False)
    # The size of the window stays.
    session.view = with_known_pose(replace(view, size=session.view.size), session.scene.animations)
    session.resolution = saved.resolution
    session.navigation.bookmarks = {**session.navigation.bookmarks, session.scene_key: saved.bookmarks}
    session.awaited_formats = {}
    for side, slot in saved.view.slots.items():
        if slot.source in BLOCK_FORMATS:
            show_source(session, side, slot.source)
    missing = [source for source in missing if source not in BLOCK_FORMATS]
    notes = [f"not open: {', '.join(missing)}"] if missing else []
    if saved.scene != session.scene.name:
        notes.append(f"it was made in scene {saved.scene}")
    notify(session, f"view from {where}" + (f"; {'; '.join(notes)}" if notes else ""))


Factor = Annotated[float, Arg(f"magnification, 1 to {LARGEST_ZOOM:g}", None, 1.0, LARGEST_ZOOM)]
PlaceX = Annotated[float, Arg("horizontal centre as a share of the picture's width, from the left", None, 0.0, 1.0)]
PlaceY = Annotated[float, Arg("vertical centre as a share of the picture's height, from the top", None, 0.0, 1.0)]


@command("view.magnify", "Magnify", "magnify the pixels of the picture")
def magnify(session: Session, factor: Factor, x: PlaceX = 0.5, y: PlaceY = 0.5) -> None:
    session.view = replace(session.view, zoom=Zoom(factor, (x, y)))


set_zoom = field_gesture("view.zoom", "view.zoom")
ViewFile = Annotated[Path, Arg("a .json; a relative path is in the folder of pictures")]


@command("view.save", "Save view", "save the view as JSON; a number is added to the name of an existing file", "Ctrl+S")
def save_view(session: Session, file: ViewFile = Path("view.json")) -> Effect:
    path = numbered_path(session.pictures_folder / file)
    return WriteText(path, view_json(present_view(session)), f"wrote {path}")


@command("view.load", "Load view", "restore a saved view")
def load_view(session: Session, file: Annotated[Path, Arg("a saved view")]) -> None:
    path = session.file_to_read(file)
    try:
        text = read_file(path, LARGEST_VIEW).decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text ({error.reason}); give a file that view.save wrote") from error
    _restore(session, text, str(path))


@command("view.copy", "Copy view", "copy the view to the clipboard as JSON", "Ctrl+C", icon="copy")
def copy_view(context: Context) -> None:
    context.write_clipboard(view_json(present_view(context.session)))
    notify(context.session, "the view is on the clipboard")


@command("view.paste", "Paste view", "restore the view from the clipboard", "Ctrl+V", icon="paste")
def paste_view(context: Context) -> None:
    text = context.read_clipboard()
    if not text.strip():
        raise InputError("view.paste: the clipboard holds no text")
    _restore(context.session, text, "clipboard")
