"""Commands: what slots A and B show, and how they are compared."""

from dataclasses import replace
from typing import Annotated, Any, Literal, get_args

from ntc.codec.config import PrecisionChoice
from ntc.errors import InputError
from ntc.metrics.block_compression import named_format
from viewer.commands.command import Arg, command, gesture
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.settings import FLICKER_RANGE, GAIN_RANGE
from viewer.state.view_state import (
    REFERENCE,
    CompareMode,
    DecodedMaps,
    DifferenceKind,
    PathChoice,
    Side,
    TexelFilter,
    is_image_source,
)

MODES: tuple[CompareMode, ...] = get_args(CompareMode)
NEXT_PATH: dict[PathChoice, PathChoice] = {
    "auto": "deferred",
    "deferred": "binned",
    "binned": "cached",
    "cached": "forward",
    "forward": "deferred",
}
SlotSide = Annotated[Side, Arg("which slot")]


def _change_slot(session: Session, side: Side, **changes: Any) -> None:
    session.view = session.view.with_slot(side, replace(session.view.slots[side], **changes))


@command(
    "compare.next", "Next mode", "show A, B, both with a divider, side by side, or their difference", "Compare", "Tab"
)
def next_mode(session: Session) -> None:
    following = MODES[(MODES.index(session.view.compare) + 1) % len(MODES)]
    session.view = replace(session.view, compare=following)


@command("compare.mode", "Mode", "show A, B, both, or their difference", "Compare")
def set_mode(session: Session, mode: Annotated[CompareMode, Arg("what is shown")]) -> None:
    session.view = replace(session.view, compare=mode)


@command("compare.toggle-flicker", "Flicker", "show A and B in turns", "Compare", "J")
def toggle_flicker(session: Session) -> None:
    session.window.flickers = not session.window.flickers


@command("compare.flicker", "Flicker rate", "show A and B in turns, so often a second", "Compare")
def set_flicker(
    session: Session, rate: Annotated[float, Arg("Hz: times a second that both are shown; 0 stops")] = 2.0
) -> None:
    low, high = FLICKER_RANGE
    if rate != 0.0 and not low <= rate <= high:
        raise InputError(f"compare.flicker: rate {rate:g} must be {low:g} to {high:g} Hz, or 0 to stop")
    session.window.flickers = rate != 0.0
    if rate != 0.0:
        session.settings = replace(session.settings, flicker_hz=rate)


@command("compare.difference", "Difference", "show the difference of A and B", "Compare")
def set_difference(session: Session, kind: Annotated[DifferenceKind, Arg("of the difference")]) -> None:
    session.view = replace(session.view, compare="difference", difference=replace(session.view.difference, kind=kind))


Gain = Annotated[float, Arg("factor of the amplified difference", None, *GAIN_RANGE)]


@command("compare.gain", "Gain", "factor of the amplified difference", "Compare")
def set_gain(session: Session, gain: Gain) -> None:
    session.view = replace(session.view, difference=replace(session.view.difference, gain=gain))


@command("compare.live", "Live figures", "compare A with B while the picture rests", "Compare")
def set_live(session: Session, state: Annotated[bool, Arg("on or off")]) -> None:
    session.settings = replace(session.settings, live_figures=state)


Position = Annotated[float, Arg("share of the width or height, 0 to 1", None, 0.0, 1.0, clamp=True)]


@command("compare.divider", "Divider", "put the divider somewhere", "Compare")
def set_divider(session: Session, position: Position = 0.5) -> None:
    session.view = replace(session.view, wipe_position=position)


@command("compare.swap", "Swap A and B", "exchange the two slots", "Compare", "X")
def swap(session: Session) -> None:
    session.view = replace(session.view, slot_a=session.view.slot_b, slot_b=session.view.slot_a)
    formats = session.requests.formats
    session.requests.formats = {"a" if side == "b" else "b": name for side, name in formats.items()}


@command("compare.measure", "Measure", "measure PSNR, divergence and memory of both slots", "Compare", "M")
def measure(session: Session) -> None:
    session.requests.measure = True


Source = Annotated[
    str, Arg('"reference", an open pack, or bc1, bc7, astc-4x4 to astc-12x12', lambda session: session.sources)
]


def show_source(session: Session, side: Side, source: str) -> None:
    """Show `source` in a slot; a block format when its textures have been encoded, which is asked for here."""
    others = {other: name for other, name in session.requests.formats.items() if other != side}
    block_format = named_format(source)
    if block_format is None or block_format in session.compressed:
        session.requests.formats = others
        _change_slot(session, side, source=source)
    else:
        session.requests.formats = {**others, side: block_format}


@gesture("slot.leave-format")
def leave_formats(session: Session) -> None:
    """Slots that wait for a block format keep what they show."""
    session.requests.formats = {}


@command("slot.source", "Source of a slot", "show a pack, the reference or a block format in a slot", "Compare")
def set_source(session: Session, side: SlotSide, source: Source) -> None:
    show_source(session, side, source)


@command("slot.path", "Path of a slot", "decode a slot by this path", "Compare")
def set_path(session: Session, side: SlotSide, path: Annotated[PathChoice, Arg("decode path")]) -> None:
    _change_slot(session, side, path=path)


Precision = Annotated[PrecisionChoice, Arg("of the decoders; auto: the cheapest that does not show")]


@command("slot.precision", "Precision of a slot", "decode a slot in this precision", "Compare")
def set_precision(session: Session, side: SlotSide, precision: Precision) -> None:
    session.requests.precision -= {side}
    if precision != "auto":
        _change_slot(session, side, precision=precision)
    elif is_image_source(source := session.view.slots[side].source):
        shown = "the reference" if source == REFERENCE else source
        raise InputError(f"slot {side.upper()} shows {shown}, which has no precision; show a pack in it first")
    else:
        session.requests.precision |= {side}


@command("slot.maps", "Maps of a slot", "decode all maps of a slot, or one among the original ones", "Compare")
def set_maps(
    session: Session, side: SlotSide, maps: Annotated[DecodedMaps, Arg("which are decoded: all, or one alone")]
) -> None:
    _change_slot(session, side, maps=maps)


TEXELS = "exact: all texels of a footprint; stochastic: one at random, accumulated at rest"


@command("slot.filter", "Filter of a slot", "filter a slot's texels exactly, or by one at random", "Compare")
def set_filter(session: Session, side: SlotSide, texels: Annotated[TexelFilter, Arg(TEXELS)]) -> None:
    _change_slot(session, side, filter=texels)


@command("slot.next-source", "Next source in A", "show the next source in slot A that is there", "Compare", "N")
def next_source(session: Session) -> None:
    sources, present = session.open_sources, session.view.slot_a.source
    place = sources.index(present) + 1 if present in sources else 0
    show_source(session, "a", sources[place % len(sources)])


@command(
    "slot.next-path",
    "Next path in A",
    "switch slot A to the next decode path: deferred, binned, cached, forward",
    "Compare",
    "P",
)
def next_path(session: Session) -> None:
    slot = session.view.slot_a
    if is_image_source(slot.source):
        shown = "the reference" if slot.source == REFERENCE else slot.source
        notify(session, f"slot A shows {shown}: it has no decode path")
    else:
        _change_slot(session, "a", path=NEXT_PATH[slot.path])


@command("filter.anisotropy", "Anisotropy", "filter images and path cached", "View")
def set_anisotropy(session: Session, value: Annotated[Literal[1, 2, 4, 8, 16], Arg("1 is trilinear")]) -> None:
    session.view = replace(session.view, anisotropy=value)


@command("filter.texels", "Texel filter", "filter the texels of both slots exactly, or by one at random", "View")
def set_filters(session: Session, texels: Annotated[TexelFilter, Arg(TEXELS)]) -> None:
    for side in get_args(Side):
        _change_slot(session, side, filter=texels)


@gesture("compare.show-other")
def show_other(session: Session, held: bool) -> None:
    session.window.show_other = held
