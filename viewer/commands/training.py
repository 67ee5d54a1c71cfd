"""Commands that encode and train in the background, and that keep, discard or show runs."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ntc.codec.config import GroupingName
from ntc.codec.encoding import RecipeName
from ntc.codec.model import Pack
from ntc.codec.registry import codec_named, codec_of
from ntc.errors import InputError
from viewer.commands.command import Arg, Context, command, field_command, gesture, unless
from viewer.commands.effects import Effect, RaisePanel
from viewer.commands.inspection import named_texture
from viewer.state.event_handlers import point_out
from viewer.state.pack_files import base_pack_name, match_scene
from viewer.state.view_state import REFERENCE, Side, is_image_source
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import EncodeScene, MoveTexture, ReencodeTexture, Regroup, RetrainGroups, TrainingJob
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
    """Return the description of a parameter that takes the text of a training setting; `more` follows the setting's help."""
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
    """Return the training after it has switched to the runs of the open scene."""
    context.training.enter(context.session.scene)
    return context.training


def _settings(budget: str, recipe: RecipeName) -> TrainingSettings:
    return replace(_DEFAULT, budget=parse_budget(budget), recipe=recipe)


def _start(context: Context, job: TrainingJob) -> Effect:
    session = context.session
    name = base_pack_name(session.view, session.packs)
    context.training.start(job, session.scene, None if name is None else session.packs[name])
    # The panel shows the progress.
    return RaisePanel("Training")


def _show_where(context: Context, pack: Pack, groups: Collection[int], textures: Collection[int] = ()) -> None:
    """Highlight textures of the picture for a moment: those of `groups`, and `textures` (numbers in `pack`)."""
    match = match_scene(pack, context.session.scene)
    members = {n for n, texture in enumerate(pack.textures) if texture.group in groups} | set(textures)
    ids = tuple(texture for texture, index in enumerate(match.texture_index) if index in members)
    # Where all textures of the pack are concerned, there is nothing to dim.
    point_out(context.session, ids if len(ids) < len(match.texture_index) else ())


@gesture("training.point-out")
def point_out_groups(context: Context, groups: frozenset[int]) -> None:
    """Highlight the textures of the groups under the mouse; an empty set ends the highlight."""
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
    "set an option of the next encoding, for the panel Training and training.encode",
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
    "Measure rate curve",
    "measure the quality of a texture at several bitrates",
)
def measure_rates(
    context: Context,
    texture: Annotated[str, Arg("number of the texture in the scene, or its name; default: the largest ones")] = "",
) -> None:
    session = context.session
    _runs(context).measure_rates(session.scene, named_texture(session, texture) if texture else None)


def _cannot_reencode(context: Context) -> str:
    if reason := _no_base(context):
        return reason
    pack = _base(context)
    texture = pack.textures[0]
    can = codec_of(pack.config).texture_bits(pack.config, (texture.width, texture.height)) is not None
    return "" if can else "the codec of this pack cannot encode one texture again; retrain its group"


@command(
    "training.anew",
    "Encode texture again",
    "encode one texture of the shown pack with other bits per texel; all others stay unchanged",
    unavailable=_cannot_reencode,
)
def reencode_texture(
    context: Context, texture: Texture, bits: Annotated[float, Arg("bits per texel of mip 0", None, 0.01, 1000.0)]
) -> Effect:
    pack = _base(context)
    index = read_texture(texture, pack)
    codec_of(pack.config).reencoding_options(pack, index, bits)
    effect = _start(context, ReencodeTexture(_DEFAULT, index, bits, pack.textures[index].name))
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


def _no_unsaved_run(context: Context) -> str:
    if context.training.saving:
        return "a pack is being written"
    return "" if context.training.log.unsaved_runs else "there is no unsaved run"


def _no_run_to_keep(context: Context) -> str:
    discarded = any(run.discarded and run.pack is not None for run in context.training.log.runs)
    return "" if discarded and not context.training.saving else _no_unsaved_run(context)


@command("training.pause", "Pause run", "pause the run", unavailable=_not_pausable, icon="pause")
def pause(context: Context) -> None:
    context.training.pause()


@command(
    "training.resume",
    "Resume run",
    "continue a paused run",
    unavailable=unless(lambda context: context.training.state in ("paused", "pausing"), "no training is paused"),
    icon="play",
)
def resume(context: Context) -> None:
    context.training.resume()


@command(
    "training.cancel",
    "Cancel run",
    "end the run; its pack stays if each group has had a result",
    unavailable=unless(lambda context: context.training.active, "no training is under way"),
    icon="xmark",
)
def cancel(context: Context) -> None:
    context.training.cancel()


RunNumber = Annotated[int, Arg("number of the run in the list; 0 takes the run that the panel Training asks about")]


@command(
    "training.keep",
    "Keep run",
    "write the pack of a run beside the scene; a number is added to a name that is taken",
    unavailable=_no_run_to_keep,
    icon="check",
)
def keep(context: Context, file: PackFile = Path(), run: RunNumber = 0) -> None:
    _runs(context).keep(run, None if file == Path() else file)


@command(
    "training.discard",
    "Discard run",
    "delete the pack of a run; until the window closes, Keep still writes it",
    unavailable=_no_unsaved_run,
    icon="trash",
)
def discard(context: Context, run: RunNumber = 0) -> None:
    _runs(context).discard(run)


@command("training.show", "Show run", "show the pack of a run in slot A or B")
def show(
    context: Context, run: Annotated[int, Arg("number of the run in the log")], side: Annotated[Side, Arg("which slot")]
) -> None:
    name, session = _runs(context).open_run(run), context.session
    slot = session.view.slots[side]
    path = "cached" if is_image_source(slot.source) else slot.path
    if {slot.source for slot in session.view.slots.values()} == {REFERENCE}:
        # A and B become both visible, as at the start of a training.
        session.view = replace(session.view, compare="wipe")
    view = session.view.with_slot(side, replace(slot, source=name, path=path))
    session.view = view if view.compare in (side, "wipe") else replace(view, compare=side)
