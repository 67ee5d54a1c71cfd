"""What scripts are tried with: which commands stay in the session, and a saved view."""

from viewer.state.camera import frame_all
from viewer.state.session import Session
from viewer.state.view_file import SavedView

REACHING_OUT = ("file.", "training.", "view.save")
"""Beginnings of commands that write files, open others, or start processes."""


def example_view(session: Session) -> SavedView:
    """The view of `session` with a bookmark."""
    return SavedView(session.scene.name, session.view, 1.0, {"bookmark": frame_all(session.scene.bounds)})
