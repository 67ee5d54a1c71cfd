"""Commands that undo and redo changes by other commands."""

from viewer.commands.command import Context, command, unless
from viewer.state.event_handlers import notify


@command(
    "edit.undo",
    "Undo",
    "undo the last change of view, settings or panels; a drag counts as one change",
    "Ctrl+Z",
    unavailable=unless(lambda context: context.history.can_undo(context.session), "there is nothing to undo"),
    icon="rotate-left",
)
def undo(context: Context) -> None:
    title = context.history.undo(context.session)
    notify(context.session, f"undone: {title}")


@command(
    "edit.redo",
    "Redo",
    "redo the change that was undone last",
    "Ctrl+Shift+Z",
    "Ctrl+Y",
    unavailable=unless(lambda context: context.history.can_redo(context.session), "there is nothing to redo"),
    icon="rotate-right",
)
def redo(context: Context) -> None:
    title = context.history.redo(context.session)
    notify(context.session, f"redone: {title}")
