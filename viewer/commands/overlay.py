"""Commands: the heatmap of decoders per block."""

from dataclasses import replace
from typing import cast, get_args

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.palettes import PALETTES, PaletteName
from viewer.state.session import Session
from viewer.state.view_state import BLOCKS, BlockName, OverlayKind


def _toggle(session: Session) -> None:
    overlay = session.view.overlay
    kind: OverlayKind = "none" if overlay.kind == "divergence" else "divergence"
    session.view = replace(session.view, overlay=replace(overlay, kind=kind))


def _kind(session: Session, kind: OverlayKind) -> None:
    session.view = replace(session.view, overlay=replace(session.view.overlay, kind=kind))


def _block(session: Session, block: BlockName) -> None:
    session.view = replace(session.view, overlay=replace(session.view.overlay, block=block))


def _next_block(session: Session) -> None:
    names = tuple(BLOCKS)
    following = names[(names.index(session.view.overlay.block) + 1) % len(names)]
    _block(session, following)
    session.say(f"decoders are counted in blocks of {following} pixels")


def _palette(session: Session, palette: PaletteName) -> None:
    session.view = replace(session.view, overlay=replace(session.view.overlay, palette=palette))


def _next_palette(session: Session) -> None:
    names = tuple(PALETTES)
    _palette(session, names[(names.index(session.view.overlay.palette) + 1) % len(names)])


def _opacity(session: Session, opacity: float) -> None:
    if not 0.0 <= opacity <= 1.0:
        raise InputError(f"opacity {opacity:g}: must be 0 to 1")
    session.view = replace(session.view, overlay=replace(session.view.overlay, opacity=opacity))


KIND = Parameter("kind", "choice", "what lies over the picture", fixed(*cast(tuple[str, ...], get_args(OverlayKind))))
BLOCK = Parameter("block", "choice", "WIDTHxHEIGHT in pixels", fixed(*BLOCKS))
PALETTE = Parameter("palette", "choice", "colours", fixed(*PALETTES))
OPACITY = Parameter("opacity", "number", "0 to 1")
COMMANDS = (
    Command(
        "overlay.toggle",
        "Divergence",
        "lay the heatmap of decoders per block over the picture",
        "Overlay",
        _toggle,
        key="O",
    ),
    Command("overlay.kind", "Overlay", "what lies over the picture", "Overlay", _kind, (KIND,)),
    Command(
        "overlay.next-block",
        "Next block shape",
        "count decoders in blocks of another shape: 8x8, 8x4, 16x4, 4x4",
        "Overlay",
        _next_block,
        key="B",
    ),
    Command("overlay.block", "Block shape", "count decoders in blocks of this shape", "Overlay", _block, (BLOCK,)),
    Command(
        "overlay.next-palette",
        "Next palette",
        "colour the heatmap green to red, or fit for the colour-blind",
        "Overlay",
        _next_palette,
        key="L",
    ),
    Command("overlay.palette", "Palette", "colours of the heatmap", "Overlay", _palette, (PALETTE,)),
    Command("overlay.opacity", "Opacity", "of the heatmap", "Overlay", _opacity, (OPACITY,)),
)
