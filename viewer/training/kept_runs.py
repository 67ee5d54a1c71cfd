"""Runs that nobody has decided about yet, in the user's data folder: a crash or a closed window loses none of them.

Each is a folder of its own with `pack.ntc`, `run.json` and `lock`. A window holds the lock of its runs for as long as it is open;
runs whose lock is free were left by a window that is gone.
"""

import json
import os
import secrets
import shutil
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import hold_lock, read_file, write_text
from ntc.pack.file import read_pack, write_pack
from viewer.locations import DATA_FOLDER_VARIABLE
from viewer.scene.json_text import convert, parse_json

PACK_FILE, FACTS_FILE, LOCK_FILE = "pack.ntc", "run.json", "lock"
LARGEST_FACTS = 1 << 16
"""Bytes."""
STALE_SECONDS = 24 * 3600.0
"""Age from which a folder without facts is what a killed process left of its first attempt."""
REMEDY = "the folder may be removed"


@dataclass(frozen=True)
class KeptRun:
    """The facts about a kept run besides its pack."""

    scene_name: str
    scene_path: str
    """Absolute path of the scene's file; "" where it comes from none."""
    scene_stamp: tuple[int, int]
    """(time of the last change in ns, bytes) of that file when the run was made; (0, 0) where it was not known."""
    title: str
    """Title of the training, such as `retrain 1 group (3)`."""
    settings: str
    outcome: str
    groups: Annotated[int, Meta(ge=0)]
    seconds: float
    """Time of training in seconds."""
    psnr_db: float | None
    """PSNR in dB, as in `Run`."""
    number: Annotated[int, Meta(ge=1)]
    """Number of the run in the window that made it."""
    ended: float
    """Seconds since the epoch."""
    key: str = ""
    """Name of its folder."""

    @property
    def clock(self) -> str:
        """Local time of its end as 12:31, with the date where that is another day."""
        then = time.localtime(self.ended)
        today = time.localtime()[:3] == then[:3]
        return time.strftime("%H:%M" if today else "%Y-%m-%d %H:%M", then)

    def is_of(self, path: Path | None) -> bool:
        """Return whether the run was made of the scene in the file `path`."""
        return path is not None and self.scene_path == str(path.resolve())

    @property
    def line(self) -> str:
        """`Bistro run 2, 12:31`."""
        return f"{self.scene_name} run {self.number}, {self.clock}"


def scene_stamp(path: Path | None) -> tuple[int, int]:
    """Return (time of the last change in ns, bytes) of a scene's file; (0, 0) where there is none."""
    if path is not None:
        with suppress(OSError):
            status = path.stat()
            return status.st_mtime_ns, status.st_size
    return 0, 0


class KeptRuns:
    """The kept runs of one user, as one window sees them."""

    def __init__(self, folder: Path) -> None:
        """`folder` is made when the first run is kept."""
        self._folder = folder
        self._claims: dict[str, int] = {}
        """Handles of the locks that this window holds, by the run's key."""

    def waiting(self) -> tuple[KeptRun, ...]:
        """Return the runs that no open window owns, newest first."""
        found = []
        with suppress(OSError):
            for place in self._folder.iterdir():
                if place.name not in self._claims and self.claim(place.name):
                    facts = self._facts(place)
                    if facts is not None:
                        found.append(facts)
                    self.release(place.name)
        return tuple(sorted(found, key=lambda run: -run.ended))

    def _facts(self, place: Path) -> KeptRun | None:
        """None for a folder that holds no run; one that was left by a killed process is removed."""
        file = place / FACTS_FILE
        try:
            text = read_file(file, LARGEST_FACTS)
            content = parse_json(text, str(file), REMEDY)
            facts: KeptRun = convert({**content, "key": place.name}, KeptRun, str(file), REMEDY)
        except FileNotFoundError:
            with suppress(OSError):
                if time.time() - place.stat().st_mtime > STALE_SECONDS:
                    shutil.rmtree(place, ignore_errors=True)
            return None
        except (OSError, InputError, TypeError):
            return None
        return facts if (place / PACK_FILE).is_file() else None

    def claim(self, key: str) -> bool:
        """Make a waiting run this window's, until it is released or removed; False where another window has it, or it is gone."""
        if key in self._claims:
            return True
        try:
            handle = os.open(self._folder / key / LOCK_FILE, os.O_RDWR)
        except OSError:
            return False
        try:
            hold_lock(handle)
        except OSError:
            os.close(handle)
            return False
        self._claims[key] = handle
        return True

    def new_key(self) -> str:
        """Make a place for one more run of this window, and return its key. Raises InputError where none can be made."""
        key = secrets.token_hex(8)
        try:
            (self._folder / key).mkdir(parents=True)
            (self._folder / key / LOCK_FILE).touch()
        except OSError as error:
            raise InputError(
                f"{self._folder}: cannot be written ({error.strerror}); set {DATA_FOLDER_VARIABLE}"
            ) from error
        if not self.claim(key):
            raise InputError(f"{self._folder}: has no locks; set {DATA_FOLDER_VARIABLE} to a folder on a local disk")
        return key

    def write(self, key: str, pack: Pack, facts: KeptRun) -> None:
        """Keep a run in its place, over its earlier version. Raises InputError. May be called in a thread."""
        place = self._folder / key
        write_pack(place / PACK_FILE, pack)
        fields = asdict(facts)
        del fields["key"]
        write_text(place / FACTS_FILE, json.dumps(fields, indent=1) + "\n")

    def read(self, key: str) -> Pack:
        """Return the pack of a run. Raises InputError."""
        return read_pack(self._folder / key / PACK_FILE)

    def remove(self, key: str) -> None:
        """Remove a run that this window has; what cannot be removed is left."""
        place = self._folder / key
        with suppress(OSError):
            (place / FACTS_FILE).unlink(missing_ok=True)
        shutil.rmtree(place, ignore_errors=True)
        self.release(key)

    def release(self, key: str) -> None:
        """Leave a run to whichever window asks for it next."""
        handle = self._claims.pop(key, None)
        if handle is not None:
            os.close(handle)
