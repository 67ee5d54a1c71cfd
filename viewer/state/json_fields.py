"""Fields of JSON that anyone may have written: each is read, or refused in one line that names it."""

from collections.abc import Mapping
from typing import Any

from ntc.errors import InputError
from viewer.scene.gltf.container import describe, printable

Vector = tuple[float, float, float]


class JsonFields:
    """The fields of one object."""

    def __init__(self, content: Any, where: str) -> None:
        """`where` names the object in messages. Raises InputError for anything that is no object."""
        if not isinstance(content, dict):
            raise InputError(f"{where}: must be an object, not {describe(content)}")
        self._content: Mapping[str, Any] = content
        self._where = where

    def __contains__(self, name: str) -> bool:
        return name in self._content

    def _refuse(self, name: str, what: str) -> InputError:
        return InputError(f"{self._where}.{name}: must be {what}, not {describe(self._content[name])}")

    def object(self, name: str) -> "JsonFields":
        """An object; an empty one where it is absent."""
        return JsonFields(self._content.get(name, {}), f"{self._where}.{name}")

    def objects(self, name: str, most: int) -> "tuple[JsonFields, ...]":
        """A list of at most `most` objects; none where it is absent."""
        entries = self._content.get(name, [])
        if not isinstance(entries, list) or len(entries) > most:
            raise self._refuse(name, f"a list of at most {most}")
        return tuple(JsonFields(entry, f"{self._where}.{name}[{index}]") for index, entry in enumerate(entries))

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """A number from `low` to `high`."""
        if name not in self._content:
            return default
        value = self._content[name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise self._refuse(name, f"a number from {low:g} to {high:g}")
        return float(value)

    def choice(self, name: str, default: Any, choices: tuple[Any, ...]) -> Any:
        """One of `choices`."""
        if name not in self._content:
            return default
        value = self._content[name]
        if isinstance(value, bool | list | dict) or value not in choices:
            raise self._refuse(name, f"one of {', '.join(map(str, choices))}")
        return value

    def text(self, name: str, default: str) -> str:
        """One line of text, not empty."""
        if name not in self._content:
            return default
        value = self._content[name]
        line = printable(value) if isinstance(value, str) else ""
        if not line:
            raise self._refuse(name, "a text")
        return line

    def vector(self, name: str, default: Vector) -> Vector:
        """Three finite numbers."""
        if name not in self._content:
            return default
        value = self._content[name]
        if not isinstance(value, list) or len(value) != 3:
            raise self._refuse(name, "three numbers")
        for number in value:
            if isinstance(number, bool) or not isinstance(number, int | float) or not abs(number) < 1e30:
                raise self._refuse(name, "three finite numbers")
        return float(value[0]), float(value[1]), float(value[2])
