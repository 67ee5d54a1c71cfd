"""Commands for slots A and B: their sources, how they are decoded, and how they are compared."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, get_args

from ntc.codec.config import PrecisionChoice
from ntc.errors import InputError
from ntc.metrics.block_compression import missing_packages, named_format
from viewer.commands.command import (
    Arg,
    Context,
    SlotSide,
    command,
    field_command,
    field_gesture,
    following,
    gesture,
    next_command,
    setter,
    unless,
)
from viewer.commands.effects import Effect, Measure, RunCommand, TakePicture, WriteText
from viewer.inspect.costs import cost_bars, costs_png
from viewer.inspect.measured_figures import figures_json, figures_markdown
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.settings import FLICKER_RANGE
from viewer.state.view_state import (
    DIFFERENCE_ARG,
    FILTER_ARG,
    PRECISION_ARG,
    REFERENCE,
    DecodePath,
    DifferenceKind,
    Side,
    TexelFilter,
    is_image_source,
)

PATHS: tuple[DecodePath, ...] = ("deferred", "binned", "cached", "forward", "on-load")


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


mode = field_command("view.compare")
next_mode = next_command(
    mode,
    "compare.next",
    "Next compare mode",
    "switch to the next mode: A, B, left/right, above/below, side by side, difference",
    "Tab",
)
toggle_flicker = field_command("window.flickers")


Rate = Annotated[float, Arg("rate in Hz, 0.2 to 30; 0 stops", ends=FLICKER_RANGE, text="%.1f Hz", logarithmic=True)]


@command(
    "compare.flicker",
    "Flicker rate",
    "alternate between A and B at this rate; 0 stops",
    current=lambda session: session.settings.flicker_hz,
    about="Rate of the flicker between A and B, in Hz.",
)
def set_flicker(session: Session, rate: Rate = 2.0) -> None:
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
    current=_shown_difference,
    about="How the difference between A and B is measured and coloured.",
    icon="circle-half-stroke",
)
def set_difference(session: Session, kind: Annotated[DifferenceKind, DIFFERENCE_ARG]) -> None:
    session.view = replace(session.view, compare="difference", difference=replace(session.view.difference, kind=kind))


gain = field_command("view.difference.gain")
live = field_command("settings.live_figures")
divider = field_command("view.wipe_position", default=0.5)


@command("compare.swap", "Swap A and B", "exchange what slots A and B show", "X", icon="right-left")
def swap(session: Session) -> None:
    session.view = replace(session.view, slot_a=session.view.slot_b, slot_b=session.view.slot_a)
    waiting = session.awaited_formats
    session.awaited_formats = {"a" if side == "b" else "b": name for side, name in waiting.items()}


@command(
    "compare.measure",
    "Measure",
    "measure PSNR, divergence, memory and decode time of both slots in the present view",
    "M",
    icon="ruler",
)
def measure(_session: Session) -> Effect:
    # The notice is shown one frame before the measurement, which stops the window for a moment.
    return RunCommand("compare.measure-now", (), "measuring A and B")


measure_now = gesture("compare.measure-now")(lambda _session: Measure())
_measured = unless(lambda context: context.session.inspection.measurements, "nothing is measured yet; measure first")


@command(
    "compare.copy-figures",
    "Copy figures",
    "copy the measured figures of A and B to the clipboard, as a table in Markdown",
    unavailable=_measured,
    icon="copy",
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
    "save the measured figures of A and B as JSON, with the picture and a chart of the costs as PNGs",
    unavailable=_measured,
    icon="floppy-disk",
)
def save_figures(session: Session, file: FiguresFile = Path()) -> Effect:
    if file != Path() and file.suffix.lower() != ".json":
        raise InputError(f"{file}: the name of a file with figures must end in .json")
    path = session.pictures_folder / file if file != Path() else session.dated_file("-figures", ".json")
    picture = TakePicture("shown", path.absolute().with_suffix(".png"))
    measured = session.inspection.measurements
    chart = costs_png(cost_bars(measured, session.compressed))
    costs = WriteText(path.with_name(f"{path.stem}-costs.png"), chart, "", picture)
    return WriteText(path, figures_json(measured), f"wrote {path}, with charts", costs)


def source_refusal(session: Session, source: str) -> str:
    """Return the reason why a source cannot be shown: the encoder of its format is not installed. Returns "" where it can."""
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
    """Show `source` in a slot. For a block format this starts the encoding; the slot shows it when the encoding is done."""
    others = {other: name for other, name in session.awaited_formats.items() if other != side}
    block_format = named_format(source)
    if block_format is None or block_format in session.compressed:
        session.awaited_formats = others
        _change_slot(session, side, source=source)
    else:
        session.awaited_formats = {**others, side: block_format}


leave_formats = gesture("slot.leave-format")(setter("awaited_formats", {}))
"""Gesture that cancels the encoding of block formats. Slots stay unchanged."""


@command(
    "slot.source",
    "Slot source",
    "show the original images, a pack, or a block format in a slot",
    current=lambda session, side: session.view.slots[side].source,
    about="What the slot shows: the original images (reference), a pack, or a block format of graphics hardware.",
)
def set_source(session: Session, side: SlotSide, source: Source) -> None:
    show_source(session, side, source)


def _unsupported(session: Session, text: str) -> str:
    return session.unsupported.get(text, "")


path = field_command("view.slot_*.path", refuses=_unsupported)
Precision = Annotated[PrecisionChoice, replace(PRECISION_ARG, refuses=_unsupported)]


@command(
    "slot.precision",
    "Slot precision",
    "choose the number format of a slot's decoders; auto picks the fastest one without visible error",
    current=_precision,
    about="Number format of the decoders on the GPU. auto measures and picks the fastest one without visible error.",
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


maps = field_command("view.slot_*.maps")
texels = field_command("view.slot_*.filter")


@command("slot.next-source", "Next source in A", "show the next open source in slot A", "N")
def next_source(session: Session) -> None:
    sources, present = session.open_sources, session.view.slot_a.source
    place = sources.index(present) + 1 if present in sources else 0
    show_source(session, "a", sources[place % len(sources)])


@command(
    "slot.next-path",
    "Next decode path in A",
    "switch slot A to the next decode path: deferred, binned, cached, forward, on-load",
    "P",
    unavailable=_a_shows_images,
)
def next_path(session: Session) -> None:
    present = session.view.slot_a.path
    path = PATHS[0] if present == "auto" else following(PATHS, present)
    while path in session.unsupported:
        path = following(PATHS, path)
    _change_slot(session, "a", path=path)


anisotropy = field_command("view.anisotropy")


@command(
    "filter.texels",
    "Texel filter",
    "filter the texels of both slots exactly, or sample one at random",
    current=_filter_of_both,
)
def set_filters(session: Session, texels: Annotated[TexelFilter, FILTER_ARG]) -> None:
    for side in get_args(Side):
        _change_slot(session, side, filter=texels)


show_other = field_gesture("compare.show-other", "window.show_other")
