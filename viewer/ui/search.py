"""Finding commands by some letters of them. Pure."""

from collections.abc import Sequence

from viewer.commands.command import Command


def score(query: str, text: str) -> float | None:
    """How well `text` fits, larger is better; None where the letters of `query` are not in it in this order."""
    query, text = query.lower(), text.lower()
    if query == text:
        return 100.0
    at = text.find(query)
    if at >= 0:
        starts_word = at == 0 or not text[at - 1].isalnum()
        return (80.0 if at == 0 else 60.0 if starts_word else 40.0) - 0.01 * len(text)
    position, gaps = -1, 0
    for letter in query:
        found = text.find(letter, position + 1)
        if found < 0:
            return None
        gaps += found - position - 1 if position >= 0 else 0
        position = found
    return 20.0 - gaps - 0.01 * len(text)


def best_first(query: str, commands: Sequence[Command]) -> tuple[Command, ...]:
    """The commands that fit `query`, best first; all, in their order, for an empty one. Words fit in any order."""
    parts = query.split()
    ranked: list[tuple[float, int, Command]] = []
    for index, command in enumerate(commands):
        total = 0.0
        for part in parts:
            # The help is prose, in which letters are found too easily: only whole parts of it count.
            fits = [score(part, command.id), score(part, command.title)]
            if part.lower() in command.help.lower():
                fits.append(10.0)
            known = [fit for fit in fits if fit is not None]
            if not known:
                break
            total += max(known)
        else:
            ranked.append((-total, index, command))
    return tuple(command for _, _, command in sorted(ranked, key=lambda entry: entry[:2]))
