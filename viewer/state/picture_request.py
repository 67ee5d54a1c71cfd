"""A picture that is wanted as a file."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from viewer.state.view_state import Overlay, ViewState

PictureKind = Literal["window", "shown", "a", "b", "split", "plain"]


@dataclass(frozen=True)
class PictureRequest:
    """Which picture, and where to."""

    kind: PictureKind = "window"
    """The window's content, or the picture alone: as shown, of one side, of both with the divider, without overlay."""
    file: Path | None = None
    """Relative to the folder of pictures; None: a name with the time in it."""
    quiet: bool = False
    """Say nothing when it has been written: the message would be in the next picture."""

    def view(self, shown: ViewState) -> ViewState:
        """What to draw, from what is shown."""
        if self.kind in ("a", "b"):
            return replace(shown, compare=self.kind)
        if self.kind == "split":
            return replace(shown, compare="wipe")
        return replace(shown, overlay=Overlay()) if self.kind == "plain" else shown
