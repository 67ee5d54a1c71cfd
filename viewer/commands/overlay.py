"""Commands for the map over the picture."""

from viewer.commands.command import command, field_command, next_command
from viewer.state.session import Session


@command(
    "overlay.toggle",
    "Divergence map",
    "show the number of decoders per block over the picture",
    "O",
    current=lambda session: session.view.overlay.kind == "divergence",
    icon="layer-group",
)
def toggle(session: Session) -> None:
    kind.function(session, "none" if session.view.overlay.kind == "divergence" else "divergence")


kind = field_command("view.overlay.kind")
block = field_command("view.overlay.block")
next_block = next_command(
    block,
    "overlay.next-block",
    "Next block shape",
    "count decoders in blocks of the next shape: 8x8, 8x4, 16x4 or 4x4 pixels",
    "B",
    lambda shape: f"decoders are counted in blocks of {shape} pixels",
)
palette = field_command("view.overlay.palette")
next_palette = next_command(
    palette,
    "overlay.next-palette",
    "Next palette",
    "switch to the next palette: green-red, or viridis, which suits the colour-blind",
    "L",
)
scale = field_command("view.overlay.scale")
opacity = field_command("view.overlay.opacity")
