"""Commands: the heatmap of decoders per block."""

from dataclasses import replace
from typing import Annotated, Any

from viewer.commands.command import Arg, command
from viewer.state.event_handlers import notify
from viewer.state.overlay import ScaleName
from viewer.state.palettes import PALETTES, PaletteName
from viewer.state.session import Session
from viewer.state.view_state import BLOCKS, BlockName, OverlayKind


def _change(session: Session, **changes: Any) -> None:
    session.view = replace(session.view, overlay=replace(session.view.overlay, **changes))


def _following(names: tuple[str, ...], present: str) -> str:
    return names[(names.index(present) + 1) % len(names)]


@command("overlay.toggle", "Divergence", "lay the heatmap of decoders per block over the picture", "Overlay", "O")
def toggle(session: Session) -> None:
    _change(session, kind="none" if session.view.overlay.kind == "divergence" else "divergence")


@command("overlay.kind", "Overlay", "what lies over the picture", "Overlay")
def set_kind(session: Session, kind: Annotated[OverlayKind, Arg("what lies over the picture")]) -> None:
    _change(session, kind=kind)


@command(
    "overlay.next-block",
    "Next block shape",
    "count decoders in blocks of another shape: 8x8, 8x4, 16x4, 4x4",
    "Overlay",
    "B",
)
def next_block(session: Session) -> None:
    block = _following(tuple(BLOCKS), session.view.overlay.block)
    _change(session, block=block)
    notify(session, f"decoders are counted in blocks of {block} pixels")


@command("overlay.block", "Block shape", "count decoders in blocks of this shape", "Overlay")
def set_block(session: Session, block: Annotated[BlockName, Arg("WIDTHxHEIGHT in pixels")]) -> None:
    _change(session, block=block)


@command(
    "overlay.next-palette",
    "Next palette",
    "colour the heatmap green to red, or fit for the colour-blind",
    "Overlay",
    "L",
)
def next_palette(session: Session) -> None:
    _change(session, palette=_following(tuple(PALETTES), session.view.overlay.palette))


@command("overlay.palette", "Palette", "colours of the heatmap", "Overlay")
def set_palette(session: Session, palette: Annotated[PaletteName, Arg("colours")]) -> None:
    _change(session, palette=palette)


@command(
    "overlay.scale",
    "Scale",
    "end the heatmap's colours at a fixed number of decoders, or at the picture's most",
    "Overlay",
)
def set_scale(
    session: Session, scale: Annotated[ScaleName, Arg("block: fixed, picture: the most of this view")]
) -> None:
    _change(session, scale=scale)


@command("overlay.opacity", "Opacity", "of the heatmap", "Overlay")
def set_opacity(session: Session, opacity: Annotated[float, Arg("0 to 1", None, 0.0, 1.0)]) -> None:
    _change(session, opacity=opacity)
