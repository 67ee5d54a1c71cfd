"""Numbering of groups."""

from collections.abc import Sequence


def in_order_of_appearance(labels: Sequence[int]) -> tuple[int, ...]:
    """`labels` renumbered 0, 1, ... by first appearance, so that a grouping does not depend on how it was found."""
    numbers: dict[int, int] = {}
    return tuple(numbers.setdefault(label, len(numbers)) for label in labels)
