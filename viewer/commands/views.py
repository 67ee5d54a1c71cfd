"""Commands: the whole view as JSON, in files and on the clipboard."""

from dataclasses import replace
from pathlib import Path

from ntc.errors import InputError
from ntc.io import write_text
from ntc.reading import read_file
from viewer.commands.command import Command, Parameter
from viewer.state.session import Session
from viewer.state.view_file import LARGEST_VIEW, parse_view, present_view, view_json, with_open_sources
from viewer.state.zoom import LARGEST, Zoom


def _restore(session: Session, text: str, where: str) -> None:
    saved = parse_view(text, where, present_view(session))
    view, missing = with_open_sources(saved.view, session.view, session.sources)
    session.motion = None
    # The window's own size stays.
    session.view = replace(view, size=session.view.size)
    session.resolution = saved.resolution
    session.keep_bookmarks(saved.bookmarks)
    notes = [f"not open: {', '.join(missing)}"] if missing else []
    if saved.scene != session.scene.name:
        notes.append(f"it was made in scene {saved.scene}")
    session.say(f"view from {where}" + (f"; {'; '.join(notes)}" if notes else ""))


def _save(session: Session, file: Path) -> None:
    path = session.pictures_folder / file
    write_text(path, view_json(present_view(session)))
    session.say(f"wrote {path}")


def _load(session: Session, file: Path) -> None:
    path = session.file_named(file)
    try:
        text = read_file(path, LARGEST_VIEW).decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text ({error.reason}); give what view.save made") from error
    _restore(session, text, str(path))


def _copy(session: Session) -> None:
    session.clipboard.write(view_json(present_view(session)))
    session.say("the view is on the clipboard")


def _paste(session: Session) -> None:
    text = session.clipboard.read()
    if not text.strip():
        raise InputError("view.paste: the clipboard holds no text")
    _restore(session, text, "clipboard")


def _magnify(session: Session, factor: float, x: float, y: float) -> None:
    if not (1.0 <= factor <= LARGEST and 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0):
        raise InputError(f"view.magnify: factor must be 1 to {LARGEST:g}, x and y 0 to 1")
    session.view = replace(session.view, zoom=Zoom(factor, (x, y)))


FACTOR = Parameter("factor", "number", f"shown pixels along a side of one of the picture, 1 to {LARGEST:g}")
PLACE = tuple(
    Parameter(
        axis, "number", f"share of the picture's {side} that is in the middle, from the upper left", default="0.5"
    )
    for axis, side in (("x", "width"), ("y", "height"))
)
SAVE_FILE = Parameter("file", "path", "a .json, in the folder of pictures unless it is absolute", default="view.json")
LOAD_FILE = Parameter("file", "path", "what view.save wrote")
COMMANDS = (
    Command("view.magnify", "Magnify", "look at the pixels themselves", "View", _magnify, (FACTOR, *PLACE)),
    Command("view.save", "Save view", "write the whole view as JSON", "View", _save, (SAVE_FILE,), key="Ctrl+S"),
    Command("view.load", "Load view", "see what view.save wrote", "View", _load, (LOAD_FILE,)),
    Command("view.copy", "Copy view", "put the whole view on the clipboard as JSON", "View", _copy, key="Ctrl+C"),
    Command("view.paste", "Paste view", "see the view on the clipboard", "View", _paste, key="Ctrl+V"),
)
