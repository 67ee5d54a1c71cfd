"""Exports of the window: a helper process writes the files beside the frames, as `ntc-viewer export` does."""

from collections.abc import Iterator
from concurrent.futures import CancelledError

from ntc.errors import InputError
from ntc.worker.helpers import HELPERS
from viewer.app.export_files import export_files
from viewer.commands.effects import Export
from viewer.jobs.job import Job, JobReport
from viewer.scene.json_text import duration
from viewer.state.event_handlers import notify
from viewer.state.message_log import details_of
from viewer.state.session import Session
from viewer.ui.facts import Work

CANCEL = "file.cancel-export"
SECONDS_TO_END = 2.0


class Exporting:
    """Runner of exports, one at a time, which writes their lines to the log."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._export: Export | None = None
        self._job: Job[list[str]] | None = None

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
        job, export = self._job, self._export
        if job is None or export is None:
            return
        report = job.report
        if report.share > 0.0:
            yield Work(export.title, report.share, report.seconds_left, CANCEL)
        else:
            yield Work(f"{export.title}, {duration(report.seconds)}", None, None, CANCEL)

    def begin(self, export: Export) -> None:
        """Begin an export. Raises InputError where one is under way."""
        if self._job is not None:
            raise InputError("file.export: another export is under way; cancel it first")
        self._export = export
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
        try:
            lines = job.result()
        except CancelledError:
            notify(self._session, f"{export.title} was cancelled")
        except InputError as error:
            notify(self._session, str(error), "error", details_of(error))
        else:
            notify(self._session, f"exported into {export.folder}", details="\n".join(lines))

    def close(self) -> None:
        """End the export under way, and wait for its process."""
        self.cancel()
        if self._job is not None:
            self._job.join(SECONDS_TO_END)


def _run(export: Export, report: JobReport) -> list[str]:
    # Compressing draws with OpenGL.
    return HELPERS.call("export", export_files, export.request, report.check, report.progress, alone=True)
