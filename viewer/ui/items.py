"""Where widgets are, so that a script can click on them by their label."""

from imgui_bundle import imgui


class ItemPlaces:
    """Rectangles of the last frame's labelled widgets, in window pixels."""

    def __init__(self) -> None:
        self._places: dict[str, tuple[float, float, float, float]] = {}

    def clear(self) -> None:
        """Forget the last frame's."""
        self._places.clear()

    def note(self, label: str) -> None:
        """Remember where the widget is that was just made."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self._places[label] = (low.x, low.y, high.x, high.y)

    def note_rectangle(self, label: str, left: float, top: float, right: float, bottom: float) -> None:
        """Remember a place that is no widget."""
        self._places[label] = (left, top, right, bottom)

    def centre(self, label: str) -> tuple[float, float]:
        """Middle of a widget. Raises KeyError when the last frame had none of that label."""
        left, top, right, bottom = self._places[label]
        return (left + right) / 2.0, (top + bottom) / 2.0

    def labels(self) -> tuple[str, ...]:
        """Labels of all widgets of the last frame."""
        return tuple(self._places)
