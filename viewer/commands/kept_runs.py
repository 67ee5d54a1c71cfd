"""Commands: what becomes of runs that windows before this one have left undecided."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from ntc.errors import InputError
from viewer.commands.command import Arg, Context, command, gesture
from viewer.commands.effects import Effect, OpenScene, RaisePanel, RunCommand
from viewer.commands.leaving import DISCARD, ask, asks_about_runs
from viewer.state.event_handlers import notify
from viewer.state.question import CANCEL, Choice, Question
from viewer.state.view_state import REFERENCE, is_image_source
from viewer.training.live_training import Decision

Action = Annotated[
    Literal["open", "keep", "discard"], Arg("open its scene and show it, write its pack beside its scene, or remove it")
]


def _none_kept_back(context: Context) -> str:
    return "" if context.training.waiting.runs else "no training was kept back"


@command(
    "training.kept-back",
    "Kept back run",
    "open, keep or discard a run that was not decided about when its window was closed",
    "Train",
    unavailable=_none_kept_back,
)
def decide(
    context: Context,
    action: Action,
    number: Annotated[
        int, Arg("which one of the list in the panel Training, 1 is the newest", minimum=1, maximum=1e6)
    ] = 1,
) -> Effect | None:
    runs = context.training.waiting.runs
    if number > len(runs):
        raise InputError(f"number {number}: there are only {len(runs)} kept runs")
    run = runs[number - 1]
    if action == "keep":
        notify(context.session, f"wrote {context.training.waiting.write(run.key)}")
    elif action == "discard":
        choices = (Choice(CANCEL), Choice(DISCARD, "training.discard-kept-back", (run.key,)))
        # The last choice is that of Escape.
        ask(context.session, Question(f"Discard {run.line}?", "Its pack is removed for good.", choices[::-1]))
    elif run.is_of(context.session.scene.path):
        return RunCommand("training.show-kept-back", (run.key,))
    elif not asks_about_runs(context, f"{run.scene_name} is opened", "training.open-kept-back", run.key):
        return RunCommand("training.open-kept-back", (run.key, "later"))
    return None


@gesture("training.discard-kept-back")
def discard(context: Context, key: str) -> None:
    context.training.waiting.discard(key)


@gesture("training.open-kept-back")
def open_leaving(context: Context, key: str, decision: Decision) -> Effect:
    """Open the scene of a waiting run, and then the run."""
    run = context.training.waiting[key]
    if not run.scene_path:
        raise InputError(f"{run.line}: its scene was not read from a file")
    return OpenScene(Path(run.scene_path), decision, RunCommand("training.show-kept-back", (key,)))


@gesture("training.show-kept-back", "Kept back run")
def show(context: Context, key: str) -> Effect:
    """Show a waiting run of the open scene in slot A."""
    session = context.session
    name = context.training.adopt(key, session.scene)
    if {slot.source for slot in session.view.slots.values()} == {REFERENCE}:
        # As when a training begins: both are seen.
        session.view = replace(session.view, compare="wipe")
    slot = session.view.slot_a
    path = "cached" if is_image_source(slot.source) else slot.path
    view = session.view.with_slot("a", replace(slot, source=name, path=path))
    session.view = view if view.compare in ("a", "wipe") else replace(view, compare="a")
    return RaisePanel("Training")
