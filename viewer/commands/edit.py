"""Commands: undoing what commands have changed."""

from viewer.commands.command import Context, command
from viewer.state.event_handlers import notify


def _nothing_to_undo(context: Context) -> str:
    return "" if context.history.can_undo(context.session) else "there is nothing to undo"


def _nothing_to_redo(context: Context) -> str:
    return "" if context.history.can_redo(context.session) else "there is nothing to redo"


@command(
    "edit.undo",
    "Undo",
    "undo the last change of view, settings or panels, or the discarding of a run; a drag counts as one change",
    "Edit",
    "Ctrl+Z",
    unavailable=_nothing_to_undo,
)
def undo(context: Context) -> None:
    title = context.history.undo(context.session, context.training)
    notify(context.session, f"undone: {title}")


@command(
    "edit.redo",
    "Redo",
    "redo the change that was undone last",
    "Edit",
    "Ctrl+Shift+Z",
    "Ctrl+Y",
    unavailable=_nothing_to_redo,
)
def redo(context: Context) -> None:
    title = context.history.redo(context.session, context.training)
    notify(context.session, f"redone: {title}")
