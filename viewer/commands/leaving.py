"""Commands: questions and answers, quitting and opening another scene while runs are undecided, and closing what is on top."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from ntc.errors import InputError
from viewer.commands.command import Context, command, gesture
from viewer.commands.effects import CancelOpening, CloseWindow, Effect, OpenScene, RunCommand
from viewer.locations import is_builtin
from viewer.scene.json_text import duration
from viewer.state.session import CANCEL, Choice, Question, Session
from viewer.training.live_training import Decision, LiveTraining
from viewer.training.preparation import job_title

KEEP, DISCARD, STOP = "Keep", "Discard", "Stop the run"


def asks_about_runs(context: Context, before: str, command_id: str, *values: Any) -> bool:
    """Ask what to do with undecided and running trainings. Returns False where there are none, and asks nothing.

    `before` names what is about to happen. The command is run with `values` and the decision once the user has answered.
    """
    training, scene, cancel = context.training, context.session.scene, Choice(CANCEL)
    saved, lost = _undecided(training)
    if not saved:
        if lost:
            stop = Choice(STOP, command_id, (*values, "discard"))
            ask(context.session, Question(f"{scene.title}: stop the run before {before}?", lost, (stop, cancel)))
        return bool(lost)
    where = "in the data folder, and the next start asks about it again"
    if scene.path is not None:
        where = "in the data folder" if is_builtin(scene.path) else f"beside {scene.path.name}"
    few, what = ("pack", "This run is") if len(saved) == 1 else ("packs", "These runs are")
    text = (f"{what} not saved yet:", *(f"  {line}" for line in saved), f"{KEEP} writes the {few} {where}.", lost)
    choices = (
        Choice(KEEP, command_id, (*values, "keep")),
        Choice(DISCARD, command_id, (*values, "discard")),
        cancel,
    )
    title = f"{scene.title}: keep the {few} before {before}?"
    ask(context.session, Question(title, "\n".join(text).rstrip(), choices))
    return True


def _undecided(training: LiveTraining) -> tuple[list[str], str]:
    """Return a line for each run that leaving the scene can save, and one for a run that it ends without a pack, "" for none."""
    saved = []
    for run in training.undecided_runs:
        quality = f", {run.psnr_db:.2f} dB" if run.psnr_db is not None else ""
        saved.append(f"{run.name}: {run.title}, {run.outcome}{quality}")
    active = training.active
    if active is None:
        return saved, ""
    left = "" if active.seconds_left is None else f", about {duration(max(active.seconds_left, 1.0))} left"
    state = "paused" if active.state in ("pausing", "paused") else f"under way{left}"
    line = f"{active.name}: {job_title(active.job)}, {state}"
    if active.pack_so_far() is None:
        return saved, f"{line}, no pack to save yet: what it has done so far is lost."
    return [*saved, f"{line}; it ends with what it has so far"], ""


def ask(session: Session, question: Question) -> None:
    """Show a question, and close the palette."""
    session.window.question, session.window.palette = question, None


@gesture("question.answer")
def answer(context: Context, label: str) -> Effect | None:
    question, context.session.window.question = context.session.window.question, None
    chosen = next((choice for choice in question.choices if choice.label == label), None) if question else None
    if chosen is None:
        raise InputError(f"{label!r}: is not an answer to an open question")
    return RunCommand(chosen.command, chosen.values) if chosen.command else None


@gesture("file.open-leaving")
def open_leaving(_session: Session, file: Path, decision: Decision) -> Effect:
    return OpenScene(file, decision)


cancel_opening = gesture("file.cancel-opening")(lambda _session: CancelOpening())


@command("file.quit", "Quit", "close the window, after a question about runs that are not saved", "Ctrl+Q")
def quit_window(context: Context) -> Effect | None:
    return None if asks_about_runs(context, "quitting", "file.quit-leaving") else CloseWindow()


@gesture("file.quit-leaving")
def quit_leaving(context: Context, decision: Decision) -> Effect:
    context.training.leave_scene(decision)
    return CloseWindow()


@command(
    "window.close", "Close at once", "close the window without a question; the next start lists runs that are not saved"
)
def close(_session: Session) -> Effect:
    return CloseWindow()


LAYERS = {
    "window.question": None,
    "window.palette": None,
    "window.show_help": False,
    "window.show_glossary": False,
    "window.file_dialog": False,
    "window.show_first_steps": False,
    "inspection.flat_texture": None,
}
"""Windows over the picture, topmost first: the session's attribute that opens each, and its value while closed."""


def _close(session: Session, layer: str) -> bool:
    """Close one of LAYERS, and return True where it was open."""
    group, _, name = layer.partition(".")
    is_open = bool(getattr(getattr(session, group), name) != LAYERS[layer])
    setattr(getattr(session, group), name, LAYERS[layer])
    if is_open and name == "show_first_steps":
        session.settings = replace(session.settings, first_steps=False)
    return is_open


@gesture("window.close-layer")
def close_layer(session: Session, layer: str) -> None:
    _close(session, layer)


def _forget_places(session: Session) -> bool:
    inspection = session.inspection
    kept = inspection.pixel is not None or inspection.block is not None
    inspection.pixel = inspection.block = None
    return kept


def _forget_highlight(session: Session) -> bool:
    inspection = session.inspection
    highlighted = inspection.selected_texture is not None or inspection.errors.highlighted_decoder is not None
    inspection.selected_texture = None
    inspection.errors = replace(inspection.errors, highlighted_decoder=None)
    return highlighted


@command(
    "window.dismiss", "Close what is on top", "close the topmost list, sheet or highlight; never the window", "Escape"
)
def dismiss(session: Session) -> Effect | None:
    closed = any(_close(session, layer) for layer in LAYERS) or _forget_places(session) or _forget_highlight(session)
    return None if closed else CancelOpening()
