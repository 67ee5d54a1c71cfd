"""What jobs and the renderer report. They are given an `EmitEvent`, which applies each event to the session.

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


@dataclass(frozen=True)
class Notification:
    """A message that is shown for some seconds and kept in the log."""

    text: str
    """One line."""
    kind: MessageKind = "message"
    details: str = ""
    """More lines, shown on request: the causes of an error."""


@dataclass(frozen=True, eq=False)
class PackUpdated:
    """A pack was opened under a name, or replaces the one that was open under it."""

    name: str
    pack: Pack


@dataclass(frozen=True)
class PackClosed:
    """A pack is to be closed. Slots that show it show again what they did when its run began, else the reference."""

    name: str


@dataclass(frozen=True)
class PackRenamed:
    """An open pack is called otherwise from now on: its run was accepted, and it has a file. No effect where that name is taken."""

    name: str
    new_name: str


@dataclass(frozen=True)
class RunStarted:
    """The first pack of a training run is open: slot A is to show it; slot B keeps what it shows."""

    name: str
    """Under which the run's pack is open."""


@dataclass(frozen=True)
class PrecisionFound:
    """The search for the cheapest precision of a slot has ended."""

    side: Side
    precision: Precision | None
    """None where there is none: the slot keeps its own."""


@dataclass(frozen=True, eq=False)
class TexturesCompressed:
    """Textures in a format of graphics hardware that slots wait for."""

    scene: Scene
    """Whose textures they are."""
    block_format: BlockFormat
    textures: CompressedTextures | None
    """None where they could not be encoded: slots keep what they show."""


@dataclass(frozen=True)
class ViewChanged:
    """The view that can be drawn in place of the one that was asked for."""

    view: ViewState


@dataclass(frozen=True, eq=False)
class Reverted:
    """What was opened cannot be drawn: what was open before is open again."""

    scene: Scene
    packs: Mapping[str, Pack]
    view: ViewState


@dataclass(frozen=True, eq=False)
class FirstViewFound:
    """The first view of a scene that has no cameras was looked for."""

    scene: Scene
    camera: Camera | None
    """None: all of the scene stays in view."""


Event = (
    Notification
    | FirstViewFound
    | PackUpdated
    | PackClosed
    | PackRenamed
    | RunStarted
    | PrecisionFound
    | TexturesCompressed
    | ViewChanged
    | Reverted
)
EmitEvent = Callable[[Event], None]
