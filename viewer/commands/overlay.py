"""Commands: maps over the picture."""

from dataclasses import replace
from typing import Annotated, Any

from viewer.commands.command import Arg, command, following, switch
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.view_state import BLOCKS, PALETTES, BlockName, OverlayKind, PaletteName, ScaleName


def _change(session: Session, **changes: Any) -> None:
    session.view = replace(session.view, overlay=replace(session.view.overlay, **changes))


@command(
    "overlay.toggle",
    "Divergence map",
    "show the number of decoders per block over the picture",
    "Overlay",
    "O",
    current=switch(lambda session: session.view.overlay.kind == "divergence"),
)
def toggle(session: Session) -> None:
    _change(session, kind="none" if session.view.overlay.kind == "divergence" else "divergence")


@command(
    "overlay.kind",
    "Overlay map",
    "show a map over the picture: decoders per block, or the error of textures or decoders",
    "Overlay",
    current=lambda session: session.view.overlay.kind,
)
def set_kind(session: Session, kind: Annotated[OverlayKind, Arg("kind of map")]) -> None:
    _change(session, kind=kind)


@command(
    "overlay.next-block",
    "Next block shape",
    "count decoders in blocks of the next shape: 8x8, 8x4, 16x4 or 4x4 pixels",
    "Overlay",
    "B",
)
def next_block(session: Session) -> None:
    block = following(tuple(BLOCKS), session.view.overlay.block)
    _change(session, block=block)
    notify(session, f"decoders are counted in blocks of {block} pixels")


@command(
    "overlay.block",
    "Block shape",
    "count decoders in blocks of this shape",
    "Overlay",
    current=lambda session: session.view.overlay.block,
)
def set_block(session: Session, block: Annotated[BlockName, Arg("WIDTHxHEIGHT in pixels")]) -> None:
    _change(session, block=block)


@command(
    "overlay.next-palette",
    "Next palette",
    "switch to the next palette: green-red, or viridis, which suits the colour-blind",
    "Overlay",
    "L",
)
def next_palette(session: Session) -> None:
    _change(session, palette=following(tuple(PALETTES), session.view.overlay.palette))


@command(
    "overlay.palette",
    "Palette",
    "choose the palette of the maps",
    "Overlay",
    current=lambda session: session.view.overlay.palette,
)
def set_palette(session: Session, palette: Annotated[PaletteName, Arg("palette")]) -> None:
    _change(session, palette=palette)


@command(
    "overlay.scale",
    "Colour range",
    "end the colours of the divergence map at a fixed number of decoders, or at the most in the picture",
    "Overlay",
    current=lambda session: session.view.overlay.scale,
)
def set_scale(
    session: Session, scale: Annotated[ScaleName, Arg("block: fixed number; picture: most decoders in this view")]
) -> None:
    _change(session, scale=scale)


@command("overlay.opacity", "Map opacity", "set the opacity of the map over the picture", "Overlay")
def set_opacity(session: Session, opacity: Annotated[float, Arg("0 to 1", None, 0.0, 1.0)]) -> None:
    _change(session, opacity=opacity)
