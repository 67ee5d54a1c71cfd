"""Dialog that opens a file: recent files, the folders of this machine, and a text field that filters names or takes a path."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, imgui, portable_file_dialogs

from ntc.errors import InputError
from viewer.inspect.memory_table import megabytes
from viewer.locations import BUILTIN_SCENES, builtin_scene_path
from viewer.scene.folder_listing import FolderEntry, completed, is_path, list_folder, matching, typed_folder
from viewer.scene.json_text import printable
from viewer.scene.model import shown_file
from viewer.scene.scene_files import (
    ARCHIVE_SUFFIX,
    MESH_SUFFIXES,
    OPENABLE,
    PACK_SUFFIX,
    PANORAMA_SUFFIXES,
    SCENE_SUFFIXES,
)
from viewer.ui.facts import UiFrame
from viewer.ui.theme import ink
from viewer.ui.widgets import DIALOG_FLAGS, place_dialog, wrapped

HELPERS = ("zenity", "matedialog", "qarma", "kdialog")
"""Programs that show the desktop's dialog on Linux."""
_PATTERNS = " ".join(
    f"*{suffix}" for suffix in (*SCENE_SUFFIXES, *MESH_SUFFIXES, ARCHIVE_SUFFIX, PACK_SUFFIX, *PANORAMA_SUFFIXES)
)


class SystemDialog:
    """File dialog of the desktop. It does not block the window; one is open at a time."""

    def __init__(self) -> None:
        self.is_available = sys.platform in ("win32", "darwin") or any(shutil.which(name) for name in HELPERS)
        self._asking: Any = None

    @property
    def has_answer(self) -> bool:
        """True where `take` returns an answer."""
        return self._asking is not None and bool(self._asking.ready(0))

    def ask(self, folder: Path) -> None:
        """Show the dialog in `folder`."""
        if self.is_available and self._asking is None:
            filters = ["Scenes, packs, panoramas", _PATTERNS, "All files", "*"]
            self._asking = portable_file_dialogs.open_file("Open", str(folder), filters)

    def take(self) -> Path | None:
        """Return the chosen file once; None without an answer, and after the dialog was cancelled."""
        if not self.has_answer:
            return None
        chosen, self._asking = self._asking.result(), None
        return Path(chosen[0]) if chosen else None


SIZE = (46.0, 30.0)
"""Largest size (width, height) of the dialog in font sizes."""
RECENT_SHARE = 0.3
"""Width of the list of recent files, as a share of the dialog."""
LABEL = "file: "
"""Prefix of the labels of entries: `file: textures/`, `file: recent town.glb`."""


class FileDialog:
    """Dialog that opens a file. It opens in the folder that it showed last."""

    def __init__(self) -> None:
        self.system = SystemDialog()
        self._was_open = False
        self._folder = Path()
        self._entries: tuple[FolderEntry, ...] = ()
        self._text = ""
        self._selected = 0
        self._problem = ""
        self._step = 0
        """Number in the text field's id. A new id replaces the field, because ImGui ignores new text of an active one."""
        self._focus = False
        self._scroll = False

    def draw(self, ui: UiFrame, size: tuple[float, float]) -> None:
        """Draw the dialog while it is open, in a window of `size` (width, height)."""
        answer = self.system.take()
        if answer is not None:
            self._open(answer, ui)
        opening, self._was_open = ui.session.window.file_dialog and not self._was_open, ui.session.window.file_dialog
        if not ui.session.window.file_dialog:
            return
        if opening:
            self._begin(ui)
        place_dialog(size, *SIZE)
        # In every frame, because a click on a panel would bring the panel in front of the dialog.
        imgui.set_next_window_focus()
        _, stays = imgui.begin("Open a scene, a pack or a panorama###open", True, DIALOG_FLAGS)
        self._content(ui)
        imgui.end()
        if not stays or imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            ui.emit("window.close-layer", "window.file_dialog")

    def _begin(self, ui: UiFrame) -> None:
        recent = ui.session.settings.recent_files
        if self._folder == Path():
            self._folder = Path(recent[0]).parent if recent else Path.cwd()
        self._go(self._folder if self._folder.is_dir() else Path.home())

    def _go(self, folder: Path) -> None:
        """Show another folder, or report that it cannot be read."""
        try:
            self._entries = list_folder(folder)
        except InputError as error:
            self._problem = str(error)
            self._focus = True
            return
        scenes = [index for index, entry in enumerate(self._entries) if entry.kind == "scene"]
        self._selected = scenes[0] if scenes else 0
        self._folder, self._problem = folder, ""
        self._set_text("")

    def _set_text(self, text: str) -> None:
        self._text = text
        self._step += 1
        self._focus = True

    def _open(self, path: Path, ui: UiFrame) -> None:
        """Open a file, or show the error in the dialog."""
        log = ui.session.window.log
        before = log[-1] if len(log) else None
        ui.emit("file.open", path)
        last = log[-1] if len(log) else None
        self._problem = last.text if last is not None and last is not before and last.kind == "error" else ""
        self._focus = True

    def _choose(self, path: Path, ui: UiFrame) -> None:
        """Show a folder, or open a file."""
        try:
            is_folder = path.is_dir()
        except OSError:
            # The name is not valid. Opening it reports that.
            is_folder = False
        if is_folder:
            self._go(path)
        else:
            self._open(path, ui)

    def _complete(self, data: imgui.InputTextCallbackData) -> int:
        # The type stubs declare this text as a number.
        typed = str(data.buf)
        text = completed(typed, self._folder)
        if text != typed:
            data.delete_chars(0, data.buf_text_len)
            data.insert_chars(0, text)
        return 0

    def _content(self, ui: UiFrame) -> None:
        entries = self._listed()
        entered = self._field(entries, ui)
        if self._problem:
            wrapped(self._problem, ink("error"))
        line = imgui.get_frame_height_with_spacing()
        room = imgui.get_content_region_avail()
        imgui.begin_child("##recent", ImVec2(room.x * RECENT_SHARE, room.y - line))
        chosen = self._recent(ui)
        imgui.end_child()
        imgui.same_line()
        imgui.begin_child("##entries", ImVec2(0.0, room.y - line))
        listed = self._list(entries, ui)
        imgui.end_child()
        pressed = self._buttons(ui)
        if entered is not None or pressed:
            self._answer(entries, entered if entered is not None else self._text, ui)
        elif chosen is not None:
            self._open(chosen, ui)
        elif listed is not None:
            self._choose(listed, ui)

    def _listed(self) -> tuple[FolderEntry, ...]:
        """Return the entries that match the typed text; for a path, entries of its folder."""
        if not is_path(self._text):
            return matching(self._entries, self._text)
        folder, beginning = typed_folder(self._text, self._folder)
        try:
            return tuple(entry for entry in list_folder(folder) if entry.name.startswith(beginning))
        except InputError:
            return ()

    def _field(self, entries: Sequence[FolderEntry], ui: UiFrame) -> str | None:
        """Draw the text field that filters names or takes a path. Returns its text on Enter, else None."""
        imgui.text_wrapped(printable(str(self._folder)))
        ui.rects.note("folder", "The folder that is listed.")
        imgui.set_next_item_width(-1.0)
        if self._focus:
            imgui.set_keyboard_focus_here()
            self._focus = False
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.callback_completion
        entered, text = imgui.input_text_with_hint(
            f"##path{self._step}",
            "type a part of a name, or a path; Tab completes it",
            self._text,
            flags,
            self._complete,
        )
        ui.rects.note("path", "Part of a name in this folder, or a path. Tab completes a path, Enter opens it.")
        if text != self._text:
            self._text, self._selected, self._problem = text, 0, ""
        for key, step in ((imgui.Key.down_arrow, 1), (imgui.Key.up_arrow, -1)):
            if entries and imgui.is_key_pressed(key):
                self._selected, self._scroll = (self._selected + step) % len(entries), True
        return text if entered else None

    def _answer(self, entries: Sequence[FolderEntry], text: str, ui: UiFrame) -> None:
        """Open the typed path, or the selected entry."""
        if is_path(text):
            folder, name = typed_folder(text.strip(), self._folder)
            self._choose(folder / name, ui)
        elif entries:
            self._choose(entries[min(self._selected, len(entries) - 1)].path, ui)
        else:
            self._problem = (
                f"no file here has {text!r} in its name; {OPENABLE}" if text else f"the folder is empty; {OPENABLE}"
            )
            self._focus = True

    def _recent(self, ui: UiFrame) -> Path | None:
        """Draw recent files and built-in scenes, and return a clicked one."""
        chosen = None
        imgui.text_disabled("Recent")
        if not ui.session.settings.recent_files:
            imgui.text_wrapped("No recent files.")
        for name in ui.session.settings.recent_files:
            path = Path(name)
            if imgui.selectable(f"{shown_file(path)}##{name}", False)[0]:
                chosen = path
            ui.rects.note(f"{LABEL}recent {shown_file(path)}", f"Open {name}")
        imgui.separator()
        imgui.text_disabled("Built in")
        for name in BUILTIN_SCENES:
            if imgui.selectable(f"{name}##built in", False)[0]:
                chosen = builtin_scene_path(name)
            ui.rects.note(f"{LABEL}{name}", "Open this scene, which comes with the program.")
        return chosen

    def _list(self, entries: Sequence[FolderEntry], ui: UiFrame) -> Path | None:
        """Draw the folder's entries in three columns, and return a double-clicked one or the folder above."""
        chosen = None
        doubly = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
        flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_double_click
        if not imgui.begin_table("entries", 3, imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y):
            return None
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("kind", imgui.TableColumnFlags_.width_fixed)
        imgui.table_setup_column("size", imgui.TableColumnFlags_.width_fixed)
        imgui.table_next_column()
        if imgui.selectable("../", False, flags)[0]:
            chosen = self._folder.parent
        ui.rects.note(f"{LABEL}../", f"Go up to {printable(str(self._folder.parent))}")
        imgui.table_next_row()
        for index, entry in enumerate(entries):
            imgui.table_next_column()
            if imgui.selectable(f"{entry.name}##{index}", index == self._selected, flags)[0]:
                self._selected = index
                chosen = entry.path if doubly or entry.kind == "folder" else chosen
            ui.rects.note(f"{LABEL}{entry.name}", printable(str(entry.path)))
            if self._scroll and index == self._selected:
                imgui.set_scroll_here_y(0.5)
                self._scroll = False
            imgui.table_next_column()
            imgui.text_disabled("" if entry.kind == "folder" else entry.kind)
            imgui.table_next_column()
            imgui.text_disabled("" if entry.kind == "folder" else megabytes(entry.size))
        imgui.end_table()
        return chosen

    def _buttons(self, ui: UiFrame) -> bool:
        """Draw the buttons at the lower edge, and return True where Open was pressed."""
        pressed = imgui.button("Open")
        ui.rects.note("Open file", "Open what is typed or selected; Enter does the same.")
        imgui.same_line()
        if imgui.button("Open folder"):
            self._open(self._folder, ui)
        ui.rects.note("Open folder", "Open the listed folder: its one scene, or its images on panels and spheres.")
        imgui.same_line()
        if imgui.button("Cancel"):
            ui.emit("window.close-layer", "window.file_dialog")
        ui.rects.note("Cancel opening", "Close the dialog; Escape does the same.")
        if self.system.is_available:
            imgui.same_line()
            if imgui.button("System dialog..."):
                self.system.ask(self._folder)
            ui.rects.note("System dialog...", "Choose the file in the file dialog of the desktop.")
        imgui.same_line()
        imgui.text_disabled(".gltf .glb .zip .obj .ply .stl .off .ntc .hdr .exr")
        return pressed
