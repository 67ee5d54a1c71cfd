"""Commands: what slots A and B show, and how they are compared."""

from dataclasses import replace
from typing import cast, get_args

from ntc.codec.precision import PrecisionChoice
from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.actions import Side
from viewer.state.session import Session
from viewer.state.settings import ANISOTROPIES, FLICKER_RANGE, GAIN_RANGE
from viewer.state.view_state import REFERENCE, CompareMode, DifferenceKind, PathChoice, Slot

MODES: tuple[CompareMode, ...] = get_args(CompareMode)
NEXT_PATH: dict[PathChoice, PathChoice] = {
    "auto": "deferred",
    "deferred": "binned",
    "binned": "cached",
    "cached": "forward",
    "forward": "deferred",
}
SIDE = Parameter("side", "choice", "which slot", fixed(*get_args(Side)))


def _slot(session: Session, side: str) -> Slot:
    return session.view.slot_a if side == "a" else session.view.slot_b


def _set_slot(session: Session, side: str, slot: Slot) -> None:
    view = session.view
    session.view = replace(view, slot_a=slot) if side == "a" else replace(view, slot_b=slot)


def _source(session: Session, side: str, source: str) -> None:
    _set_slot(session, side, replace(_slot(session, side), source=source))


def _path(session: Session, side: str, path: PathChoice) -> None:
    _set_slot(session, side, replace(_slot(session, side), path=path))


def _precision(session: Session, side: Side, precision: PrecisionChoice) -> None:
    session.precision_wishes -= {side}
    if precision != "auto":
        _set_slot(session, side, replace(_slot(session, side), precision=precision))
    elif _slot(session, side).source == REFERENCE:
        raise InputError(f"slot {side.upper()} shows the reference, which has no precision; show a pack in it first")
    else:
        session.precision_wishes |= {side}


def _mode(session: Session, mode: CompareMode) -> None:
    session.view = replace(session.view, compare=mode)


def _next_mode(session: Session) -> None:
    _mode(session, MODES[(MODES.index(session.view.compare) + 1) % len(MODES)])


def _next_path(session: Session) -> None:
    slot = session.view.slot_a
    if slot.source == REFERENCE:
        session.say("slot A shows the reference: it has no decode path")
        return
    session.view = replace(session.view, slot_a=replace(slot, path=NEXT_PATH[slot.path]))


def _next_source(session: Session) -> None:
    sources = session.sources
    slot = session.view.slot_a
    following = sources[(sources.index(slot.source) + 1) % len(sources)] if slot.source in sources else sources[0]
    session.view = replace(session.view, slot_a=replace(slot, source=following))


def _swap(session: Session) -> None:
    session.view = replace(session.view, slot_a=session.view.slot_b, slot_b=session.view.slot_a)


def _divider(session: Session, position: float) -> None:
    session.view = replace(session.view, wipe_position=min(max(position, 0.0), 1.0))


def _toggle_flicker(session: Session) -> None:
    session.flickers = not session.flickers


def _flicker(session: Session, rate: float) -> None:
    if rate == 0.0:
        session.flickers = False
        return
    low, high = FLICKER_RANGE
    if not low <= rate <= high:
        raise InputError(f"compare.flicker: rate {rate:g} must be {low:g} to {high:g} Hz, or 0 to stop")
    session.settings = replace(session.settings, flicker_hz=rate)
    session.flickers = True


def _difference(session: Session, kind: DifferenceKind) -> None:
    session.view = replace(session.view, compare="difference", difference=replace(session.view.difference, kind=kind))


def _gain(session: Session, gain: float) -> None:
    low, high = GAIN_RANGE
    if not low <= gain <= high:
        raise InputError(f"compare.gain: {gain:g} must be {low:g} to {high:g}")
    session.view = replace(session.view, difference=replace(session.view.difference, gain=gain))


def _live(session: Session, state: str) -> None:
    session.settings = replace(session.settings, live_figures=state == "on")


def _anisotropy(session: Session, value: str) -> None:
    session.view = replace(session.view, anisotropy=int(value))


def _measure(session: Session) -> None:
    session.measure_requested = True


SOURCE = Parameter("source", "choice", '"reference" or an open pack', lambda session: session.sources)
PATH = Parameter("path", "choice", "decode path", fixed(*cast(tuple[str, ...], get_args(PathChoice))))
PRECISION = Parameter(
    "precision",
    "choice",
    "of the decoders; auto: the cheapest that does not show",
    fixed(*cast(tuple[str, ...], get_args(PrecisionChoice))),
)
MODE = Parameter("mode", "choice", "what is shown", fixed(*MODES))
POSITION = Parameter("position", "number", "share of the width or height, 0 to 1", default="0.5")
RATE = Parameter("rate", "number", "Hz: times a second that both are shown; 0 stops", default="2")
DIFFERENCE = Parameter("kind", "choice", "of the difference", fixed(*cast(tuple[str, ...], get_args(DifferenceKind))))
GAIN = Parameter("gain", "number", "factor of the amplified difference")
STATE = Parameter("state", "choice", "on or off", fixed("on", "off"))
ANISOTROPY = Parameter("value", "choice", "1 is trilinear", fixed(*(str(value) for value in ANISOTROPIES)))
COMMANDS = (
    Command(
        "compare.next",
        "Next mode",
        "show A, B, both with a divider, side by side, or their difference",
        "Compare",
        _next_mode,
        key="Tab",
    ),
    Command("compare.mode", "Mode", "show A, B, both, or their difference", "Compare", _mode, (MODE,)),
    Command("compare.toggle-flicker", "Flicker", "show A and B in turns", "Compare", _toggle_flicker, key="J"),
    Command(
        "compare.flicker", "Flicker rate", "show A and B in turns, so often a second", "Compare", _flicker, (RATE,)
    ),
    Command(
        "compare.difference", "Difference", "show the difference of A and B", "Compare", _difference, (DIFFERENCE,)
    ),
    Command("compare.gain", "Gain", "factor of the amplified difference", "Compare", _gain, (GAIN,)),
    Command("compare.live", "Live figures", "compare A with B while the picture rests", "Compare", _live, (STATE,)),
    Command("compare.divider", "Divider", "put the divider somewhere", "Compare", _divider, (POSITION,)),
    Command("compare.swap", "Swap A and B", "exchange the two slots", "Compare", _swap, key="X"),
    Command(
        "compare.measure", "Measure", "measure PSNR, divergence and memory of both slots", "Compare", _measure, key="M"
    ),
    Command(
        "slot.source", "Source of a slot", "show a pack or the reference in a slot", "Compare", _source, (SIDE, SOURCE)
    ),
    Command("slot.path", "Path of a slot", "decode a slot by this path", "Compare", _path, (SIDE, PATH)),
    Command(
        "slot.precision",
        "Precision of a slot",
        "decode a slot in this precision",
        "Compare",
        _precision,
        (SIDE, PRECISION),
    ),
    Command(
        "slot.next-source", "Next source in A", "show the next open pack in slot A", "Compare", _next_source, key="N"
    ),
    Command(
        "slot.next-path",
        "Next path in A",
        "switch slot A to the next decode path: deferred, binned, cached, forward",
        "Compare",
        _next_path,
        key="P",
    ),
    Command(
        "filter.anisotropy", "Anisotropy", "filter the reference and path cached", "View", _anisotropy, (ANISOTROPY,)
    ),
)
