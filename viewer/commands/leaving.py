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

KEEP, DISCARD, STOP = "Keep", "Discard", "Stop encoding"


def asks_about_runs(context: Context, before: str, command_id: str, *values: Any) -> bool:
    """Ask what to do with undecided and running trainings. Returns False where there are none, and asks nothing.

    `before` names what is about to happen. The command is run with `values` and the decision once the user has answered.
    """
    training, scene = context.training, context.session.scene
    lines = _undecided(training)
    if not lines:
        return False
    if not training.undecided_runs and training.active is not None and training.active.pack_so_far() is None:
        stop = Choice(STOP, command_id, (*values, "discard"))
        text = "\n".join((*lines, "What is encoded so far is lost."))
        ask(context.session, Question(f"{scene.title}: stop encoding before {before}?", text, (stop, Choice(CANCEL))))
        return True
    where = "in the data folder, until the next start"
    if scene.path is not None:
        where = "in the data folder" if is_builtin(scene.path) else f"beside {scene.path.name}"
    few = "pack" if len(lines) == 1 else "packs"
    what = "This training has" if len(lines) == 1 else "These trainings have"
    text = "\n".join(
        (f"{what} not been saved yet:", *(f"  {line}" for line in lines), f"{KEEP} writes the {few} {where}.")
    )
    choices = (
        Choice(KEEP, command_id, (*values, "keep")),
        Choice(DISCARD, command_id, (*values, "discard")),
        Choice(CANCEL),
    )
    ask(context.session, Question(f"{scene.title}: keep the {few} before {before}?", text, choices))
    return True


def _undecided(training: LiveTraining) -> tuple[str, ...]:
    """Return one line for each run that leaving the scene would end or leave undecided."""
    lines = []
    for run in training.undecided_runs:
        quality = f", {run.psnr_db:.2f} dB" if run.psnr_db is not None else ""
        lines.append(f"{run.name}: {run.title}, {run.outcome}{quality}")
    if training.active is not None:
        left = training.active.seconds_left
        time_left = "" if left is None else f", about {duration(max(left, 1.0))} left"
        picture = "" if training.active.pack_so_far() is not None else ", no pack to save yet"
        lines.append(f"{training.active.name}: {job_title(training.active.job)}, under way{time_left}{picture}")
    return tuple(lines)


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


@command("file.quit", "Quit", "close the window; undecided trainings are asked about first", "Ctrl+Q")
def quit_window(context: Context) -> Effect | None:
    return None if asks_about_runs(context, "quitting", "file.quit-leaving") else CloseWindow()


@gesture("file.quit-leaving")
def quit_leaving(context: Context, decision: Decision) -> Effect:
    context.training.leave_scene(decision)
    return CloseWindow()


@command(
    "window.close", "Close at once", "close the window without a question; undecided trainings wait for the next start"
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
