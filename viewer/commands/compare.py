"""Commands: what slots A and B show, and how they are compared."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from ntc.codec.config import PrecisionChoice
from ntc.errors import InputError
from ntc.metrics.block_compression import missing_packages, named_format
from viewer.commands.command import Arg, Context, command, following, gesture, switch
from viewer.commands.effects import Effect, Measure, RunCommand, TakePicture, WriteText
from viewer.inspect.measured_figures import figures_json, figures_markdown
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.settings import FLICKER_RANGE
from viewer.state.view_state import (
    GAIN_RANGE,
    REFERENCE,
    CompareMode,
    DecodedMaps,
    DecodePath,
    DifferenceKind,
    PathChoice,
    Side,
    TexelFilter,
    is_image_source,
)

MODES: tuple[CompareMode, ...] = get_args(CompareMode)
PATHS: tuple[DecodePath, ...] = ("deferred", "binned", "cached", "forward")
SlotSide = Annotated[Side, Arg("which slot")]


def _shown_difference(session: Session) -> str | None:
    return session.view.difference.kind if session.view.compare == "difference" else None


def _precision(session: Session, side: Side) -> str:
    return "auto" if side in session.precision_searches else session.view.slots[side].precision


def _filter_of_both(session: Session) -> str | None:
    filters = {slot.filter for slot in session.view.slots.values()}
    return filters.pop() if len(filters) == 1 else None


def _a_shows_images(context: Context) -> str:
    source = context.session.view.slot_a.source
    shown = "the reference" if source == REFERENCE else source
    return f"slot A shows {shown}, which is not decoded; show a pack in it first" if is_image_source(source) else ""


def _change_slot(session: Session, side: Side, **changes: Any) -> None:
    session.view = session.view.with_slot(side, replace(session.view.slots[side], **changes))


@command(
    "compare.next",
    "Next compare mode",
    "switch to the next mode: A, B, left/right, above/below, side by side, difference",
    "Compare",
    "Tab",
)
def next_mode(session: Session) -> None:
    session.view = replace(session.view, compare=following(MODES, session.view.compare))


@command(
    "compare.mode",
    "Compare mode",
    "show A, B, both with a divider, both side by side, or their difference",
    "Compare",
    current=lambda session: session.view.compare,
)
def set_mode(session: Session, mode: Annotated[CompareMode, Arg("what is shown")]) -> None:
    session.view = replace(session.view, compare=mode)


@command(
    "compare.toggle-flicker",
    "Flicker",
    "alternate between A and B",
    "Compare",
    "J",
    current=switch(lambda session: session.window.flickers),
)
def toggle_flicker(session: Session) -> None:
    session.window.flickers = not session.window.flickers


@command("compare.flicker", "Flicker rate", "alternate between A and B at this rate; 0 stops", "Compare")
def set_flicker(session: Session, rate: Annotated[float, Arg("rate in Hz, 0.2 to 30; 0 stops")] = 2.0) -> None:
    low, high = FLICKER_RANGE
    if rate != 0.0 and not low <= rate <= high:
        raise InputError(f"compare.flicker: rate {rate:g} must be {low:g} to {high:g} Hz, or 0 to stop")
    session.window.flickers = rate != 0.0
    if rate != 0.0:
        session.settings = replace(session.settings, flicker_hz=rate)


@command(
    "compare.difference",
    "Difference",
    "show the difference between A and B: raw, amplified, relative or FLIP",
    "Compare",
    current=_shown_difference,
)
def set_difference(session: Session, kind: Annotated[DifferenceKind, Arg("kind of difference")]) -> None:
    session.view = replace(session.view, compare="difference", difference=replace(session.view.difference, kind=kind))


Gain = Annotated[float, Arg("factor of the amplified difference", None, *GAIN_RANGE)]


@command(
    "compare.gain",
    "Difference gain",
    "set the factor of the amplified difference",
    "Compare",
)
def set_gain(session: Session, gain: Gain) -> None:
    session.view = replace(session.view, difference=replace(session.view.difference, gain=gain))


@command(
    "compare.live",
    "Live figures",
    "measure A against B whenever the picture rests",
    "Compare",
    current=switch(lambda session: session.settings.live_figures),
)
def set_live(session: Session, state: Annotated[bool, Arg("on or off")]) -> None:
    session.settings = replace(session.settings, live_figures=state)


Position = Annotated[float, Arg("place as a share of the width or height, 0 to 1", None, 0.0, 1.0, clamp=True)]


@command(
    "compare.divider",
    "Centre the divider",
    "move the divider to the middle, or to a share of the picture's width or height",
    "Compare",
)
def set_divider(session: Session, position: Position = 0.5) -> None:
    session.view = replace(session.view, wipe_position=position)


@command("compare.swap", "Swap A and B", "exchange what slots A and B show", "Compare", "X")
def swap(session: Session) -> None:
    session.view = replace(session.view, slot_a=session.view.slot_b, slot_b=session.view.slot_a)
    waiting = session.awaited_formats
    session.awaited_formats = {"a" if side == "b" else "b": name for side, name in waiting.items()}


@command(
    "compare.measure",
    "Measure",
    "measure PSNR, divergence, memory and decode time of both slots in the present view",
    "Compare",
    "M",
)
def measure(_session: Session) -> Effect:
    # A frame says so before: a picture of each slot takes a moment.
    return RunCommand("compare.measure-now", (), "measuring A and B")


@gesture("compare.measure-now")
def measure_now(_session: Session) -> Effect:
    return Measure()


def _not_measured(context: Context) -> str:
    return "" if context.session.inspection.measurements else "nothing is measured yet; measure first"


@command(
    "compare.copy-figures",
    "Copy figures",
    "copy the measured figures of A and B to the clipboard, as a table in Markdown",
    "Compare",
    unavailable=_not_measured,
)
def copy_figures(context: Context) -> None:
    context.write_clipboard(figures_markdown(context.session.inspection.measurements))
    notify(context.session, "the figures are on the clipboard, as a table in Markdown")


FiguresFile = Annotated[
    Path, Arg("a .json; a relative path is in the folder of pictures; default: named by scene and time")
]


@command(
    "compare.save-figures",
    "Save figures",
    "save the measured figures of A and B as JSON, and the picture beside it as a PNG",
    "Compare",
    unavailable=_not_measured,
)
def save_figures(session: Session, file: FiguresFile = Path()) -> Effect:
    if file != Path() and file.suffix.lower() != ".json":
        raise InputError(f"{file}: the name of a file with figures must end in .json")
    path = session.pictures_folder / file if file != Path() else session.dated_file("-figures", ".json")
    picture = TakePicture("shown", path.absolute().with_suffix(".png"))
    return WriteText(path, figures_json(session.inspection.measurements), f"wrote {path}", picture)


def source_refusal(session: Session, source: str) -> str:
    """Return why a source cannot be shown: a format whose encoder is not installed. "" where it can."""
    block_format = named_format(source)
    known = block_format is None or block_format in session.compressed
    return "" if known or block_format is None else missing_packages(block_format)


Source = Annotated[
    str,
    Arg(
        '"reference", an open pack, or bc1, bc7, astc-4x4 to astc-12x12',
        lambda session: session.sources,
        refuses=source_refusal,
    ),
]


def show_source(session: Session, side: Side, source: str) -> None:
    """Show `source` in a slot. A block format is shown when its textures have been encoded, which begins now."""
    others = {other: name for other, name in session.awaited_formats.items() if other != side}
    block_format = named_format(source)
    if block_format is None or block_format in session.compressed:
        session.awaited_formats = others
        _change_slot(session, side, source=source)
    else:
        session.awaited_formats = {**others, side: block_format}


@gesture("slot.leave-format")
def leave_formats(session: Session) -> None:
    """Cancel the encoding of block formats; slots keep what they show."""
    session.awaited_formats = {}


@command(
    "slot.source",
    "Slot source",
    "show the original images, a pack, or a block format in a slot",
    "Compare",
    current=lambda session, side: session.view.slots[side].source,
)
def set_source(session: Session, side: SlotSide, source: Source) -> None:
    show_source(session, side, source)


def _unsupported(session: Session, text: str) -> str:
    return session.unsupported.get(text, "")


@command(
    "slot.path",
    "Slot decode path",
    "choose the decode path of a slot",
    "Compare",
    current=lambda session, side: session.view.slots[side].path,
)
def set_path(
    session: Session, side: SlotSide, path: Annotated[PathChoice, Arg("decode path", refuses=_unsupported)]
) -> None:
    _change_slot(session, side, path=path)


Precision = Annotated[
    PrecisionChoice,
    Arg(
        "number format of the decoders; auto measures and picks the fastest one without visible error",
        refuses=_unsupported,
    ),
]


@command(
    "slot.precision",
    "Slot precision",
    "choose the number format of a slot's decoders; auto picks the fastest one without visible error",
    "Compare",
    current=_precision,
)
def set_precision(session: Session, side: SlotSide, precision: Precision) -> None:
    session.precision_searches -= {side}
    if precision != "auto":
        _change_slot(session, side, precision=precision)
    elif is_image_source(source := session.view.slots[side].source):
        shown = "the reference" if source == REFERENCE else source
        raise InputError(f"slot {side.upper()} shows {shown}, which has no precision; show a pack in it first")
    else:
        session.precision_searches |= {side}


@command(
    "slot.maps",
    "Slot maps",
    "decode all maps of a slot, or only one and keep the others original",
    "Compare",
    current=lambda session, side: session.view.slots[side].maps,
)
def set_maps(
    session: Session, side: SlotSide, maps: Annotated[DecodedMaps, Arg("decoded maps: all, or only one")]
) -> None:
    _change_slot(session, side, maps=maps)


TEXELS = "exact: all texels of the footprint; stochastic: one random texel, accumulated while the picture rests"


@command(
    "slot.filter",
    "Slot texel filter",
    "filter a slot's texels exactly, or sample one at random",
    "Compare",
    current=lambda session, side: session.view.slots[side].filter,
)
def set_filter(session: Session, side: SlotSide, texels: Annotated[TexelFilter, Arg(TEXELS)]) -> None:
    _change_slot(session, side, filter=texels)


@command("slot.next-source", "Next source in A", "show the next open source in slot A", "Compare", "N")
def next_source(session: Session) -> None:
    sources, present = session.open_sources, session.view.slot_a.source
    place = sources.index(present) + 1 if present in sources else 0
    show_source(session, "a", sources[place % len(sources)])


@command(
    "slot.next-path",
    "Next decode path in A",
    "switch slot A to the next decode path: deferred, binned, cached, forward",
    "Compare",
    "P",
    unavailable=_a_shows_images,
)
def next_path(session: Session) -> None:
    present = session.view.slot_a.path
    path = PATHS[0] if present == "auto" else following(PATHS, present)
    while path in session.unsupported:
        path = following(PATHS, path)
    _change_slot(session, "a", path=path)


@command(
    "filter.anisotropy",
    "Anisotropy",
    "set the anisotropic filtering of images and path cached, 1 (trilinear) to 16 samples",
    "View",
    current=lambda session: str(session.view.anisotropy),
)
def set_anisotropy(session: Session, value: Annotated[Literal[1, 2, 4, 8, 16], Arg("1 is trilinear")]) -> None:
    session.view = replace(session.view, anisotropy=value)


@command(
    "filter.texels",
    "Texel filter",
    "filter the texels of both slots exactly, or sample one at random",
    "View",
    current=_filter_of_both,
)
def set_filters(session: Session, texels: Annotated[TexelFilter, Arg(TEXELS)]) -> None:
    for side in get_args(Side):
        _change_slot(session, side, filter=texels)


@gesture("compare.show-other")
def show_other(session: Session, held: bool) -> None:
    session.window.show_other = held
