"""Commands: encode and train in the background, and decide about runs, those of earlier windows included."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from ntc.codec.config import GroupingName
from ntc.codec.encoding import RecipeName
from ntc.codec.model import Pack
from ntc.codec.registry import codec_named, codec_of
from ntc.errors import InputError
from ntc.io import numbered_path
from viewer.commands.command import Arg, Context, command, field_command, gesture, unless
from viewer.commands.effects import Effect, OpenScene, RaisePanel, RunCommand
from viewer.commands.inspection import named_texture
from viewer.commands.leaving import DISCARD, ask, asks_about_runs
from viewer.state.event_handlers import notify, point_out
from viewer.state.pack_files import base_pack_name, match_scene
from viewer.state.session import CANCEL, Choice, Question
from viewer.state.view_state import REFERENCE, Side, is_image_source
from viewer.training.live_training import Decision, LiveTraining
from viewer.training.preparation import EncodeAnew, EncodeScene, MoveTexture, Regroup, RetrainGroups, TrainingJob
from viewer.training.run_keeper import checked_path
from viewer.training.settings import (
    ALL,
    AUTO,
    FULL,
    SETTINGS,
    WORST,
    TrainingSettings,
    budget_text,
    parse_budget,
    read_clusters,
    read_groups,
    read_number,
    read_texture,
    with_setting,
)

NEW_GROUP = "new"
_DEFAULT = TrainingSettings()
_BUDGET = budget_text(_DEFAULT.budget)
AS_CHOSEN = "default: as chosen in the panel Training"


def _typed(name: str, more: str = "") -> Arg:
    """Return the description of a setting of the training for a command that takes its text; `more` follows the help."""
    arg = SETTINGS[name][1]
    return Arg(f"{arg.help}{more}", arg.choices)


OR_AUTO = f"; {AUTO} chooses it"
Strategy = Annotated[GroupingName, _typed("grouping")]
GroupCount = Annotated[str, _typed("groups", OR_AUTO)]
Budget = Annotated[str, _typed("budget")]
Recipe = Annotated[RecipeName, _typed("recipe")]
Groups = Annotated[str, Arg(f"groups such as 0,3,5, or {ALL}, or {WORST}")]
Texture = Annotated[str, Arg("name of the texture in the pack, or its number")]
Group = Annotated[str, Arg(f"number of the group, or {NEW_GROUP}")]
PackFile = Annotated[Path, Arg("a .ntc file; default: SCENE.GROUPING.ntc beside the scene")]


def _runs(context: Context) -> LiveTraining:
    """Return the training with the runs of the open scene."""
    context.training.enter(context.session.scene)
    return context.training


def _settings(budget: str, recipe: RecipeName) -> TrainingSettings:
    return replace(_DEFAULT, budget=parse_budget(budget), recipe=recipe)


def _start(context: Context, job: TrainingJob) -> Effect:
    session = context.session
    name = base_pack_name(session.view, session.packs)
    context.training.start(job, session.scene, None if name is None else (name, session.packs[name]))
    # The panel shows the progress.
    return RaisePanel("Training")


def _show_where(context: Context, pack: Pack, groups: Collection[int], textures: Collection[int] = ()) -> None:
    """Highlight textures of the picture for a moment: those of `groups`, and `textures` by their number in `pack`."""
    found = match_scene(pack, context.session.scene)
    members = {n for n, texture in enumerate(pack.textures) if texture.group in groups} | set(textures)
    ids = tuple(texture for texture, index in enumerate(found.texture_index) if index in members)
    # All textures of the pack: dimming the rest would show nothing.
    point_out(context.session, ids if len(ids) < len(found.texture_index) else ())


@gesture("training.point-out")
def point_out_groups(context: Context, groups: frozenset[int]) -> None:
    """Highlight the textures of groups whose names are under the mouse; an empty set ends that."""
    _show_where(context, _base(context), groups)


def _base(context: Context) -> Pack:
    name = base_pack_name(context.session.view, context.session.packs)
    if name is None:
        raise InputError("training: no pack is open to continue from; encode the scene first (training.encode)")
    return context.session.packs[name]


def _training_is_busy(context: Context) -> str:
    if context.training.active is not None:
        return "another run is under way; cancel it first"
    return "a pack is being written; try again in a moment" if context.training.saving else ""


def _no_base(context: Context) -> str:
    known = base_pack_name(context.session.view, context.session.packs) is not None
    return _training_is_busy(context) or ("" if known else "there is no pack to continue from; encode the scene first")


ENCODE_SETTINGS = ("grouping", "groups", "size", "budget", "recipe", "codec", "target")
"""Settings that the command training.encode takes, in this order."""


@command(
    "training.encode",
    "Encode the scene",
    "encode the open scene into a new pack, as chosen in the panel Training; values replace the chosen ones",
    unavailable=_training_is_busy,
    icon="box-archive",
)
def encode(
    context: Context,
    strategy: Annotated[str, _typed("grouping", f"; {AS_CHOSEN}")] = "",
    k: Annotated[str, _typed("groups", OR_AUTO)] = "",
    size: Annotated[str, _typed("size", f"; {FULL} keeps all")] = "",
    budget: Annotated[str, _typed("budget", "; codec block needs none")] = "",
    recipe: Annotated[str, _typed("recipe")] = "",
    codec: Annotated[str, _typed("codec", f" {AUTO}: block for best, grid for paper and for a budget of steps")] = "",
    target: Annotated[str, _typed("target")] = "",
) -> Effect:
    settings = _runs(context).plan
    texts = zip(ENCODE_SETTINGS, (strategy, k, size, budget, recipe, codec, target), strict=True)
    for name, text in texts:
        settings = with_setting(settings, name, str(text)) if name != "recipe" and text != "" else settings
    if recipe:
        settings = with_setting(settings, "recipe", recipe)
        if settings.codec is not None and recipe != _DEFAULT.recipe and not codec_named(settings.codec).trains:
            raise InputError(f"recipe {recipe}: trains codec grid; leave it out, or take codec grid")
    return _start(context, EncodeScene(settings))


@command(
    "training.choose",
    "Choose how to encode",
    "set how the next encoding is done: the offer, the panel Training and training.encode follow",
)
def choose(
    context: Context,
    setting: Annotated[str, Arg(f"what to set: {', '.join(SETTINGS)}", lambda _session: tuple(SETTINGS))],
    value: Annotated[str, Arg(f"value as training.encode takes it; {AUTO} takes the default")],
) -> None:
    training = _runs(context)
    training.plan = with_setting(training.plan, setting, value)


@command(
    "training.measure-rates",
    "Measure what bits give",
    "measure the quality of a texture at several bitrates, and the speed of this machine",
)
def measure_rates(
    context: Context,
    texture: Annotated[str, Arg("number of the texture in the scene, or its name; default: the largest ones")] = "",
) -> None:
    session = context.session
    _runs(context).measure_rates(session.scene, named_texture(session, texture) if texture else None)


def _cannot_encode_anew(context: Context) -> str:
    if reason := _no_base(context):
        return reason
    pack = _base(context)
    own = pack.textures[0]
    can = codec_of(pack.config).texture_bits(pack.config, (own.width, own.height)) is not None
    return "" if can else "the codec of this pack cannot encode one texture again; retrain its group"


@command(
    "training.anew",
    "Encode texture again",
    "encode one texture of the shown pack with other bits per texel; all others stay unchanged",
    unavailable=_cannot_encode_anew,
)
def encode_anew(
    context: Context, texture: Texture, bits: Annotated[float, Arg("bits per texel of mip 0", None, 0.01, 1000.0)]
) -> Effect:
    pack = _base(context)
    index = read_texture(texture, pack)
    codec_of(pack.config).anew_options(pack, index, bits)
    effect = _start(context, EncodeAnew(_DEFAULT, index, bits, pack.textures[index].name))
    _show_where(context, pack, (), {index})
    return effect


def _not_retrainable(context: Context) -> str:
    if reason := _no_base(context):
        return reason
    trains = codec_of(_base(context).config).trains
    return "" if trains else "the codec of this pack is not trained; encode a texture with other bits (training.anew)"


@command(
    "training.retrain",
    "Retrain groups",
    "continue training some groups of the shown pack; all others stay unchanged",
    unavailable=_not_retrainable,
    icon="arrows-rotate",
)
def retrain(context: Context, groups: Groups, budget: Budget = _BUDGET, recipe: Recipe = _DEFAULT.recipe) -> Effect:
    pack = _base(context)
    chosen = read_groups(groups, pack)
    effect = _start(context, RetrainGroups(_settings(budget, recipe), chosen))
    _show_where(context, pack, chosen)
    return effect


@command(
    "training.move", "Move texture", "move a texture into another group, and train both groups", unavailable=_no_base
)
def move(
    context: Context, texture: Texture, group: Group, budget: Budget = _BUDGET, recipe: Recipe = _DEFAULT.recipe
) -> Effect:
    pack = _base(context)
    count = pack.grouping.group_count
    number = count if group == NEW_GROUP else read_number(group, "group", count - 1)
    moved = read_texture(texture, pack)
    effect = _start(context, MoveTexture(_settings(budget, recipe), moved, number))
    _show_where(context, pack, {number}, {moved})
    return effect


@command(
    "training.regroup",
    "Regroup",
    "make new groups, and train those that changed, starting from the shown pack",
    unavailable=_no_base,
)
def regroup(
    context: Context,
    strategy: Strategy,
    k: GroupCount = AUTO,
    budget: Budget = _BUDGET,
    recipe: Recipe = _DEFAULT.recipe,
) -> Effect:
    settings = replace(_settings(budget, recipe), strategy=strategy, clusters=read_clusters(k))
    return _start(context, Regroup(settings))


ahead = field_command("settings.prepare_encoding")


def _not_pausable(context: Context) -> str:
    reasons = {
        "training": "",
        "idle": "no training is under way",
        "preparing": "the training has not begun yet; wait, or cancel it",
    }
    return reasons.get(context.training.state, "the training is already paused or cancelled")


def _none_to_decide(context: Context) -> str:
    if context.training.saving:
        return "the pack is being written"
    return "" if context.training.log.undecided is not None else "no finished run waits to be accepted or discarded"


def _none_to_accept(context: Context) -> str:
    if context.training.saving:
        return "the pack is being written"
    return "" if context.training.undecided_runs else "no finished run waits to be accepted or discarded"


@command("training.pause", "Pause training", "pause the training", unavailable=_not_pausable, icon="pause")
def pause(context: Context) -> None:
    context.training.pause()


@command(
    "training.resume",
    "Resume training",
    "continue a paused training",
    unavailable=unless(lambda context: context.training.state in ("paused", "pausing"), "no training is paused"),
    icon="play",
)
def resume(context: Context) -> None:
    context.training.resume()


@command(
    "training.cancel",
    "Cancel training",
    "stop the training; its last result stays visible",
    unavailable=unless(lambda context: context.training.active, "no training is under way"),
    icon="xmark",
)
def cancel(context: Context) -> None:
    context.training.cancel()


@command("training.accept", "Accept run", "save the pack of a run to a file", unavailable=_none_to_accept, icon="check")
def accept(
    context: Context,
    file: PackFile = Path(),
    run: Annotated[int, Arg("number of the run in the log; 0 takes the one that the panel Training asks about")] = 0,
) -> None:
    training, session = _runs(context), context.session
    if run:
        training.choose_run(run)
    if file == Path() or not checked_path(file, session.scene.path).exists():
        training.accept(None if file == Path() else file, session.packs.values())
        return
    other = numbered_path(file)
    choices = (
        Choice(f"Write {other.name}", "training.accept", (other,)),
        Choice("Replace", "training.accept-over", (file,)),
        Choice(CANCEL),
    )
    ask(session, Question(f"Replace {file.name}?", f"{file} is there already.", choices))


@gesture("training.accept-over")
def accept_over(context: Context, file: Path) -> None:
    _runs(context).accept(file, context.session.packs.values())


@command(
    "training.discard",
    "Discard run",
    "discard the last run, and show what was shown before it",
    unavailable=_none_to_decide,
    icon="trash",
)
def discard(context: Context) -> None:
    _runs(context).discard()


@command("training.show", "Show run", "show the pack of a run in slot A or B")
def show(
    context: Context, run: Annotated[int, Arg("number of the run in the log")], side: Annotated[Side, Arg("which slot")]
) -> None:
    name, session = _runs(context).open_run(run), context.session
    slot = session.view.slots[side]
    path = "cached" if is_image_source(slot.source) else slot.path
    view = session.view.with_slot(side, replace(slot, source=name, path=path))
    session.view = view if view.compare in (side, "wipe") else replace(view, compare=side)


Action = Annotated[
    Literal["open", "keep", "discard"], Arg("open its scene and show it, save its pack beside the scene, or remove it")
]


@command(
    "training.kept-back",
    "Restore unsaved run",
    "open, keep or discard a run that was undecided when its window closed",
    unavailable=unless(lambda context: context.training.waiting.runs, "there is no unsaved run"),
)
def decide(
    context: Context,
    action: Action,
    number: Annotated[
        int, Arg("number in the list of the panel Training, 1 is the newest", minimum=1, maximum=1e6)
    ] = 1,
) -> Effect | None:
    runs = context.training.waiting.runs
    if number > len(runs):
        raise InputError(f"number {number}: the number of unsaved runs is {len(runs)}")
    run = runs[number - 1]
    if action == "keep":
        notify(context.session, f"wrote {context.training.waiting.write(run.key)}")
    elif action == "discard":
        choices = (Choice(CANCEL), Choice(DISCARD, "training.discard-kept-back", (run.key,)))
        # Escape takes the last choice.
        ask(context.session, Question(f"Discard {run.line}?", "Its pack is deleted.", choices[::-1]))
    elif run.is_of(context.session.scene.path):
        return RunCommand("training.show-kept-back", (run.key,))
    elif not asks_about_runs(context, f"{run.scene_name} is opened", "training.open-kept-back", run.key):
        return RunCommand("training.open-kept-back", (run.key, "later"))
    return None


@gesture("training.discard-kept-back")
def discard_kept(context: Context, key: str) -> None:
    context.training.waiting.discard(key)


@gesture("training.open-kept-back")
def open_leaving(context: Context, key: str, decision: Decision) -> Effect:
    """Open the scene of an undecided run, then show the run."""
    run = context.training.waiting[key]
    if not run.scene_path:
        raise InputError(f"{run.line}: its scene was not read from a file")
    return OpenScene(Path(run.scene_path), decision, RunCommand("training.show-kept-back", (key,)))


@gesture("training.show-kept-back", "Restore unsaved run")
def show_kept(context: Context, key: str) -> Effect:
    """Show an undecided run of the open scene in slot A."""
    session = context.session
    name = context.training.adopt(key, session.scene)
    if {slot.source for slot in session.view.slots.values()} == {REFERENCE}:
        # As when a training begins: A and B are both visible.
        session.view = replace(session.view, compare="wipe")
    slot = session.view.slot_a
    path = "cached" if is_image_source(slot.source) else slot.path
    view = session.view.with_slot("a", replace(slot, source=name, path=path))
    session.view = view if view.compare in ("a", "wipe") else replace(view, compare="a")
    return RaisePanel("Training")
