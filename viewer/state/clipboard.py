"""Text that other programs can have."""

from typing import Protocol


class Clipboard(Protocol):
    """Where copied text is."""

    def read(self) -> str:
        """The text; "" for none."""
        ...

    def write(self, text: str) -> None:
        """Replace it."""
        ...


class LocalClipboard:
    """One that only this program sees."""

    def __init__(self) -> None:
        self._text = ""

    def read(self) -> str:
        """The text; "" for none."""
        return self._text

    def write(self, text: str) -> None:
        """Replace it."""
        self._text = text
