"""The desktop's own dialog for opening a file, where it has one."""

import shutil
import sys
from pathlib import Path
from typing import Any

from imgui_bundle import portable_file_dialogs

from viewer.scene.scene_files import ARCHIVE_SUFFIX, MESH_SUFFIXES, PACK_SUFFIX, PANORAMA_SUFFIXES, SCENE_SUFFIXES

HELPERS = ("zenity", "matedialog", "qarma", "kdialog")
"""Programs that show it on Linux."""
_PATTERNS = " ".join(
    f"*{suffix}" for suffix in (*SCENE_SUFFIXES, *MESH_SUFFIXES, ARCHIVE_SUFFIX, PACK_SUFFIX, *PANORAMA_SUFFIXES)
)


class SystemDialog:
    """Asks beside the frames; at most one question at a time."""

    def __init__(self) -> None:
        self.is_available = sys.platform in ("win32", "darwin") or any(shutil.which(name) for name in HELPERS)
        self._asking: Any = None

    @property
    def has_answer(self) -> bool:
        """Whether `take` has something to take."""
        return self._asking is not None and bool(self._asking.ready(0))

    def ask(self, folder: Path) -> None:
        """Show the dialog, which begins in `folder`."""
        if self.is_available and self._asking is None:
            filters = ["Scenes, packs, panoramas", _PATTERNS, "All files", "*"]
            self._asking = portable_file_dialogs.open_file("Open", str(folder), filters)

    def take(self) -> Path | None:
        """The file that was chosen; None while there is no answer, and where the dialog was left without one."""
        if not self.has_answer:
            return None
        chosen, self._asking = self._asking.result(), None
        return Path(chosen[0]) if chosen else None
