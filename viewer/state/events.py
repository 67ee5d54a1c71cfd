"""Events that jobs and the renderer report through an `EmitEvent`, which applies each to the session.

The functions of `viewer.state.event_handlers` are the only code besides the commands that changes a session.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ntc.codec.config import Precision
from ntc.codec.model import Pack
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.scene.model import Camera, Scene
from viewer.state.message_log import MessageKind
from viewer.state.view_state import Side, ViewState


class Event:
    """Report of a job or the renderer, which changes the session."""


@dataclass(frozen=True)
class Notification(Event):
    """Message that is shown for some seconds and stays in the log."""

    text: str
    """Message in one line."""
    kind: MessageKind = "message"
    details: str = ""
    """Further lines, shown on request, such as the causes of an error."""


@dataclass(frozen=True, eq=False)
class PackUpdated(Event):
    """A pack that was opened under a name, or that replaces the pack of that name."""

    name: str
    pack: Pack


@dataclass(frozen=True)
class PackClosed(Event):
    """Request to close a pack. Slots that show it go back to what they showed before its run, else to the reference."""

    name: str


@dataclass(frozen=True)
class PackRenamed(Event):
    """New name of an open pack whose run was written to a file. No effect where the name is taken."""

    name: str
    new_name: str


@dataclass(frozen=True)
class PackShown(Event):
    """Request to show an open pack in slot A; slot B keeps what it shows. When the pack is closed, both go back."""

    name: str


@dataclass(frozen=True)
class PrecisionChosen(Event):
    """Result of the search for the fastest precision of a slot."""

    side: Side
    precision: Precision | None
    """Chosen precision; None without a result, which leaves the slot as it is."""


@dataclass(frozen=True, eq=False)
class TexturesCompressed(Event):
    """Textures in a block format of graphics hardware that slots wait for."""

    scene: Scene
    """Scene of the textures."""
    block_format: BlockFormat
    textures: CompressedTextures | None
    """Encoded textures; None where encoding failed: slots keep what they show."""


@dataclass(frozen=True)
class ViewChanged(Event):
    """View to draw in place of one that cannot be drawn."""

    view: ViewState


@dataclass(frozen=True, eq=False)
class Reverted(Event):
    """State before an opened file that cannot be drawn: it is restored."""

    scene: Scene
    packs: Mapping[str, Pack]
    view: ViewState


@dataclass(frozen=True, eq=False)
class FirstViewChosen(Event):
    """Result of the search for a first view in a scene without cameras."""

    scene: Scene
    camera: Camera | None
    """Chosen camera; None leaves the view of the whole scene."""


EmitEvent = Callable[[Event], None]
