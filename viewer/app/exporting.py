"""`ntc-viewer export` beside the frames: the window exports as the command line does, in a process of its own."""

import re
import subprocess
import sys
import time
from collections.abc import Iterator

from ntc.errors import InputError
from viewer.commands.effects import Export
from viewer.jobs.job import Job, JobReport
from viewer.scene.json_text import duration, time_left
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.ui.facts import Work

CANCEL = "file.cancel-export"
SECONDS_BETWEEN_CHECKS = 0.05
SECONDS_TO_END = 2.0
SHARE = re.compile(rb"^ *(\d+)%", re.MULTILINE)
"""Lines in which the command tells how far it is (`TerminalProgress`)."""


class Exporting:
    """One export at a time. Its lines go to the log."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._export: Export | None = None
        self._job: Job[subprocess.CompletedProcess[str]] | None = None
        self._began = 0.0

    @property
    def is_under_way(self) -> bool:
        """True while an export runs."""
        return self._job is not None

    @property
    def is_due(self) -> bool:
        """True where the next frame tells that an export has ended."""
        return self._job is not None and self._job.done

    @property
    def work(self) -> Iterator[Work]:
        """Yield the export under way, for the status bar."""
        job, export, now = self._job, self._export, time.monotonic()
        if job is None or export is None:
            return
        share = job.report.share
        if share > 0.0:
            yield Work(export.title, share, time_left(now - self._began, share), CANCEL)
        else:
            yield Work(f"{export.title}, {duration(now - self._began)}", None, None, CANCEL)

    def begin(self, export: Export) -> None:
        """Begin an export. Raises InputError where one is under way."""
        if self._job is not None:
            raise InputError("file.export: another export is under way; cancel it first")
        self._export, self._began = export, time.monotonic()
        self._job = Job(lambda report: _run(export, report)).start("export")

    def cancel(self) -> None:
        """End the export under way."""
        if self._job is not None:
            self._job.report.cancelled = True

    def advance(self) -> None:
        """Tell the end of an export, before a frame."""
        job, export = self._job, self._export
        if job is None or export is None or not job.done:
            return
        self._job = self._export = None
        if job.report.cancelled:
            notify(self._session, f"{export.title} was cancelled")
            return
        ended = job.result()
        if ended.returncode == 0:
            notify(self._session, f"exported into {export.folder}", details=ended.stdout)
        else:
            # The last line names the error.
            lines = [line for line in ended.stderr.splitlines() if line.strip()] or [
                "export: gave no answer; try again"
            ]
            notify(self._session, lines[-1].removeprefix("error: "), "error", ended.stderr)

    def close(self) -> None:
        """End the export under way, and wait for its process."""
        self.cancel()
        if self._job is not None:
            self._job.join(SECONDS_TO_END)


def _run(export: Export, report: JobReport) -> subprocess.CompletedProcess[str]:
    """Run the command until it ends, or is cancelled; `report` has the share that it told last."""
    command = [sys.executable, "-m", "viewer", "export", *export.arguments]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while True:
            try:
                # What it has written is taken meanwhile.
                out, err = process.communicate(timeout=SECONDS_BETWEEN_CHECKS)
            except subprocess.TimeoutExpired as waiting:
                if report.cancelled:
                    process.kill()
                elif told := SHARE.findall(waiting.stderr or b""):
                    report.share = int(told[-1]) / 100.0
            else:
                return subprocess.CompletedProcess(command, process.returncode, out, err)
