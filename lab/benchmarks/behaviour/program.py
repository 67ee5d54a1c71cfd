"""Calls of the program of a checkout, and what is kept of each."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

LONGEST_RUN = 600.0
OUTPUT = "output.txt"
PATIENCE = (8, 24, 72, 150)
"""Seconds that the word PATIENCE stands for in arguments, one try after another."""


@dataclass(frozen=True)
class Run:
    """One call of the program. OUT in an argument becomes the folder of what is kept, WORK that of inputs, KEEP the command that
    writes a run."""

    name: str
    arguments: tuple[str, ...]
    keep: tuple[str, ...] | None = None
    """Files that are kept; None: all."""
    fails: bool | None = False
    """Whether an exit status other than 0 is expected; None: that depends on the driver."""


@dataclass(frozen=True)
class Program:
    """The program of a checkout, and the folder with inputs made for it."""

    repository: Path
    work: Path

    def normalised(self, text: str) -> str:
        """Printed text without what differs from run to run: folders, times and progress."""
        for folder, name in ((self.work, "WORK"), (self.repository, "CHECKOUT")):
            text = text.replace(str(folder), name)
        lines = (line.rstrip() for line in text.replace("\r", "\n").splitlines())
        lines = (line for line in lines if not re.match(r"\s*\d+%  ", line))
        return re.sub(r"in \d+ s on|at most [\d.]+ GB of memory", "TIME", "\n".join(lines)) + "\n"

    def start(self, arguments: Sequence[str], scratch: Path) -> subprocess.CompletedProcess[str]:
        """Run the program to its end, with settings and caches of its own in `scratch`."""
        environment = {
            **{name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")},
            "PYTHONPATH": str(self.repository),
            "NTC_VIEWER_CONFIG_DIR": str(scratch / "settings"),
            "NTC_VIEWER_CACHE_DIR": str(scratch / "cache"),
            "NTC_VIEWER_DATA_DIR": str(scratch / "data"),
            "OMP_NUM_THREADS": "1",  # Sums of threads come in no fixed order.
            "COLUMNS": "200",
        }
        return subprocess.run(
            [sys.executable, "-m", "viewer", *arguments],
            cwd=self.repository,
            env=environment,
            timeout=LONGEST_RUN,
            capture_output=True,
            text=True,
            check=False,
        )

    def record(self, run: Run, folder: Path) -> None:
        """Run it, and keep the files it wrote and the text it printed in `folder`."""
        tries = PATIENCE if any("PATIENCE" in text for text in run.arguments) else PATIENCE[:1]
        for seconds in tries:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            if self._try(run, folder, seconds):
                break
        else:
            print(f"  {folder.name}: unexpected {(folder / OUTPUT).read_text().strip()[:400]}", file=sys.stderr)
            missing = [name for name in run.keep or () if not (folder / name).exists()]
            if missing:
                print(f"  {folder.name}: not written: {', '.join(missing)}", file=sys.stderr)
        stats = folder / "stats.json"
        if stats.exists():
            content = json.loads(stats.read_text())
            content.pop("timings_ms", None)
            stats.write_text(json.dumps(content, indent=1) + "\n")

    def _try(self, run: Run, folder: Path, patience: int) -> bool:
        """One call; whether it ended as expected and wrote all files of `run.keep`."""
        with tempfile.TemporaryDirectory(dir=self.work) as name:
            scratch = Path(name)
            out = scratch / "out"
            out.mkdir()
            words = {"OUT": out, "WORK": self.work, "BUILTIN": self.work / "builtin", "PATIENCE": patience}
            autosaves = (self.repository / "viewer" / "training" / "run_store.py").exists()
            words["KEEP"] = "training.keep" if autosaves else "training.accept"
            arguments = [re.sub("|".join(words), lambda word: str(words[word[0]]), text) for text in run.arguments]
            ran = self.start(arguments, scratch)
            text = f"exit status {ran.returncode}\n{ran.stdout}{ran.stderr}".replace(str(out), "OUT")
            (folder / OUTPUT).write_text(self.normalised(text))
            if run.fails is None and ran.returncode:
                return True
            for file in [*out.rglob("*"), *(scratch / "settings").glob("*")]:
                if file.is_file() and (run.keep is None or file.name in run.keep):
                    shutil.copy(file, folder / "_".join(file.relative_to(scratch).parts[1:]))
            return (ran.returncode != 0) == run.fails and all((folder / name).exists() for name in run.keep or ())
