"""Layout of the comparison: which slot fills which part of the picture. One rule for shader, mouse and labels."""

from dataclasses import dataclass

from viewer.state.view_state import CompareMode, Side, Slot, ViewState

WIPES: tuple[CompareMode, ...] = ("wipe", "wipe-horizontal")


@dataclass(frozen=True)
class CompareLayout:
    """A line that divides the picture between two slots."""

    vertical: bool
    """True for a vertical line, with the first slot left of it; else the first slot is above a horizontal line."""
    position: float
    """Position of the line as a share of the picture's width or height."""
    shift: float = 0.0
    """Shift of what the first part shows to the right, and of what the second shows to the left, as a share of the width."""


def layout_of(view: ViewState) -> CompareLayout | None:
    """Return the line of a view; None where one slot or the difference fills the picture."""
    if view.compare == "side-by-side":
        # Each half shows the middle of the same picture, pixel by pixel: nothing is drawn at another size.
        return CompareLayout(True, 0.5, 0.25)
    return CompareLayout(view.compare == "wipe", view.wipe_position) if view.compare in WIPES else None


def shown_slots(view: ViewState) -> tuple[Slot, Slot]:
    """Return the slots of the first and the second part; twice the same where one slot fills the picture."""
    first, second = shown_sides(view)
    return view.slots[first], view.slots[second]


def shown_sides(view: ViewState) -> tuple[Side, Side]:
    """Return the sides of `shown_slots`."""
    if view.compare in ("a", "b"):
        return ("a", "a") if view.compare == "a" else ("b", "b")
    return ("b", "a") if view.flipped else ("a", "b")


def _shift_at(split: CompareLayout | None, second: bool) -> float:
    if split is None:
        return 0.0
    return -split.shift if second else split.shift


def _is_second(split: CompareLayout | None, x: float, y: float) -> bool:
    return split is not None and (x if split.vertical else y) >= split.position


def window_to_image(view: ViewState, x: float, y: float) -> tuple[float, float]:
    """Return the place of the picture that is shown at (x, y) of the window; both are shares from the upper left corner."""
    split = layout_of(view)
    return view.zoom.window_to_image(x + _shift_at(split, _is_second(split, x, y)), y)


def image_to_window(view: ViewState, x: float, y: float) -> tuple[tuple[float, float], ...]:
    """Return the places in the window that show (x, y) of the picture: one, or two side by side. Inverse of `window_to_image`.

    Side by side, a place outside its part of the window is left out.
    """
    split = layout_of(view)
    shown_x, shown_y = view.zoom.image_to_window(x, y)
    if split is None or split.shift == 0.0:
        return ((shown_x, shown_y),)
    places = ((shown_x - _shift_at(split, second), shown_y) for second in (False, True))
    return tuple(at for second, at in zip((False, True), places, strict=True) if _is_second(split, *at) == second)
