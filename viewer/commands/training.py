"""Commands: train in the background, and what becomes of it."""

from dataclasses import replace
from pathlib import Path
from typing import cast, get_args

from ntc.codec.config import GroupingName, RecipeName
from ntc.errors import InputError
from ntc.pack.model import Pack
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.actions import Side
from viewer.state.pack_files import base_pack_name
from viewer.state.session import Session
from viewer.state.view_state import REFERENCE
from viewer.training.preparation import EncodeScene, MoveTexture, Regroup, RetrainGroups, TrainingJob
from viewer.training.settings import AUTO, TrainingSettings, budget_text, parse_budget, read_clusters, read_size

NEW_GROUP = "new"
WORST = "worst"
ALL = "all"
_DEFAULT = TrainingSettings()


def _settings(budget: str, recipe: str) -> TrainingSettings:
    name = next(name for name in get_args(RecipeName) if name == recipe)
    return replace(_DEFAULT, budget=parse_budget(budget), recipe=name)


def _strategy(text: str) -> GroupingName:
    return cast(GroupingName, text)


def _start(session: Session, job: TrainingJob) -> None:
    name = base_pack_name(session.view, session.packs)
    session.training.start(job, session.scene, None if name is None else (name, session.packs[name]))
    # It shows the progress.
    session.raised_panel = "Training"


def _encode(session: Session, strategy: str, k: str, size: str, budget: str, recipe: str) -> None:
    settings = replace(
        _settings(budget, recipe),
        strategy=_strategy(strategy),
        clusters=read_clusters(k),
        texture_size=read_size(size),
    )
    _start(session, EncodeScene(settings))


def _base(session: Session) -> Pack:
    name = base_pack_name(session.view, session.packs)
    if name is None:
        raise InputError("training: there is no pack to go on from; encode the scene first (training.encode)")
    return session.packs[name]


def _whole(text: str, what: str, most: int) -> int:
    if not text.isdecimal() or int(text) > most:
        raise InputError(f"{what} {text!r}: must be a whole number from 0 to {most}")
    return int(text)


def _groups(text: str, pack: Pack) -> frozenset[int]:
    count = pack.grouping.group_count
    if text == ALL:
        return frozenset(range(count))
    if text == WORST:
        known = {texture.group: texture.psnr_db for texture in pack.textures if texture.psnr_db is not None}
        for texture in pack.textures:
            if texture.psnr_db is not None:
                known[texture.group] = min(known[texture.group] or 0.0, texture.psnr_db)
        if not known:
            raise InputError("groups: no PSNR is known of this pack; name the groups")
        return frozenset({min(known, key=lambda group: known[group] or 0.0)})
    parts = text.replace(",", " ").split()
    if not parts:
        raise InputError(f"groups {text!r}: name some, as in 0,3,5")
    return frozenset(_whole(part, "group", count - 1) for part in parts)


def _retrain(session: Session, groups: str, budget: str, recipe: str) -> None:
    chosen = _groups(groups, _base(session))
    _start(session, RetrainGroups(_settings(budget, recipe), chosen))


def _texture(text: str, pack: Pack) -> int:
    names = [texture.name for texture in pack.textures]
    if text in names:
        return names.index(text)
    if not text.isdecimal():
        raise InputError(f"texture {text!r}: the pack has none of that name; give its name, or its number from 0")
    return _whole(text, "texture", len(names) - 1)


def _move(session: Session, texture: str, group: str, budget: str, recipe: str) -> None:
    pack = _base(session)
    count = pack.grouping.group_count
    number = count if group == NEW_GROUP else _whole(group, "group", count - 1)
    job = MoveTexture(_settings(budget, recipe), _texture(texture, pack), number)
    _start(session, job)


def _regroup(session: Session, strategy: str, k: str, budget: str, recipe: str) -> None:
    settings = replace(_settings(budget, recipe), strategy=_strategy(strategy), clusters=read_clusters(k))
    _start(session, Regroup(settings))


def _pause(session: Session) -> None:
    session.training.pause()


def _resume(session: Session) -> None:
    session.training.resume()


def _cancel(session: Session) -> None:
    session.training.cancel()


def _accept(session: Session, file: Path | str) -> None:
    path = None if str(file) in ("", ".") else Path(file)
    session.training.accept(path, session.scene, session.packs.values())


def _discard(session: Session) -> None:
    session.training.discard()


def _show(session: Session, run: int, side: Side) -> None:
    name = session.training.open_run(run)
    slot = session.view.slots[side]
    path = "cached" if slot.source == REFERENCE else slot.path
    view = session.view.with_slot(side, replace(slot, source=name, path=path))
    session.view = view if view.compare in (side, "wipe") else replace(view, compare=side)


STRATEGIES = tuple(get_args(GroupingName))
STRATEGY = Parameter("strategy", "choice", "which textures share a decoder", fixed(*STRATEGIES), _DEFAULT.strategy)
K = Parameter("k", "text", f"groups, or {AUTO}", default=AUTO)
SIZE = Parameter("size", "text", "most texels of a texture along one side", default=str(_DEFAULT.texture_size))
BUDGET = Parameter("budget", "text", "how long: 500steps, 30s or 35dB", default=budget_text(_DEFAULT.budget))
RECIPE = Parameter("recipe", "choice", "how it is trained", fixed(*get_args(RecipeName)), _DEFAULT.recipe)
GROUPS = Parameter("groups", "text", f"numbers as in 0,3,5, or {ALL}, or {WORST}")
TEXTURE = Parameter("texture", "text", "its name in the pack, or its number")
GROUP = Parameter("group", "text", f"number of the group, or {NEW_GROUP}")
FILE = Parameter("file", "path", "a .ntc file; without one SCENE.GROUPING.ntc beside the scene", default="")
RUN = Parameter("run", "whole", "its number in the log")
SIDE = Parameter("side", "choice", "which slot", fixed(*get_args(Side)))
COMMANDS = (
    Command(
        "training.encode",
        "Encode the scene",
        "make a pack of the open scene from nothing; the picture sharpens as it trains",
        "Train",
        _encode,
        (STRATEGY, K, SIZE, BUDGET, RECIPE),
    ),
    Command(
        "training.retrain",
        "Retrain groups",
        "go on training some groups of the shown pack; all others stay as they are",
        "Train",
        _retrain,
        (GROUPS, BUDGET, RECIPE),
    ),
    Command(
        "training.move",
        "Move a texture",
        "put a texture into another group, and train both",
        "Train",
        _move,
        (TEXTURE, GROUP, BUDGET, RECIPE),
    ),
    Command(
        "training.regroup",
        "Regroup",
        "find groups anew, and train those that have changed from the shown pack on",
        "Train",
        _regroup,
        (replace(STRATEGY, default=None), K, BUDGET, RECIPE),
    ),
    Command("training.pause", "Pause training", "let the training stand still", "Train", _pause),
    Command("training.resume", "Resume training", "let the training go on", "Train", _resume),
    Command("training.cancel", "Cancel training", "end the training; the last picture stays", "Train", _cancel),
    Command("training.accept", "Accept", "write the pack of the last run to a file", "Train", _accept, (FILE,)),
    Command("training.discard", "Discard", "show again what was shown before the last run", "Train", _discard),
    Command("training.show", "Show a run", "put the pack of a run into slot A or B", "Train", _show, (RUN, SIDE)),
)
