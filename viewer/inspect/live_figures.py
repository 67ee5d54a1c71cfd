"""What the panels say of A against B."""

from dataclasses import dataclass

from viewer.inspect.comparison import Comparison
from viewer.state.view_state import REFERENCE, ViewState


@dataclass(frozen=True, eq=False)
class LiveFigures:
    """What the panels say of A against B."""

    comparison: Comparison | None = None
    """The last one that was made."""
    is_current: bool = False
    """Whether it is of the picture that is shown."""
    computing: bool = False
    seconds: float = 0.0
    """That it took, from reading back to the result."""
    source: str = REFERENCE
    """Whose decoders the errors are told apart by: A's, else B's."""
    problem: str = ""
    """Why there is none."""


def compared_source(view: ViewState) -> str:
    """Whose decoders errors are told apart by: slot A's, or slot B's where A shows the reference."""
    return view.slot_a.source if view.slot_a.source != REFERENCE else view.slot_b.source
