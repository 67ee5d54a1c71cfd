"""Random calls of the commands that can run now, from the registry of commands."""

import random
from collections.abc import Sequence
from pathlib import Path

from viewer.commands import COMMANDS
from viewer.commands.command import Command, Context, Parameter

LEFT_OUT = frozenset({"file.quit"})
"""Commands that a trial does not call, because they end the window."""
TEXTS = {
    "texture": ("0", "1", "worst"),
    "group": ("0", "1", "new"),
    "groups": ("all", "worst", "0", "0,1"),
    "k": ("auto", "1", "2"),
    "size": ("16", "32", "full"),
    "budget": ("1s", "2s", "40steps"),
    "target": ("2bits", "30dB", "0.01MB"),
    "value": ("auto", "1", "16", "2bits", "1s", "best", "clustered"),
}
"""Texts of parameters that are neither numbers nor choices, by name. Other parameters get one of WORDS."""
WORDS = ("a", "roof", "0", "")
NUMBERS = (-10.0, 10.0)
"""Range of numbers whose parameter has no range."""
GIVEN_SHARE = 0.6
"""Probability that an optional parameter is given."""


def random_call(
    context: Context, files: Sequence[Path], source: random.Random, subject: str = ""
) -> tuple[Command, tuple[str, ...]]:
    """Return a command that can run now, with texts of its parameters. Commands that open files get one of `files`.

    `subject` is the beginning of the command's id, such as `training.`. Where no such command can run, another one is returned.
    """
    possible = [command for command in COMMANDS if command.id not in LEFT_OUT and not command.why_not(context)]
    command = source.choice([command for command in possible if command.id.startswith(subject)] or possible)
    texts: list[str] = []
    for parameter in command.parameters:
        if parameter.default_text is not None and source.random() > GIVEN_SHARE:
            break
        text = _text(parameter, context, files, source)
        if text is None:
            break
        texts.append(text)
    return command, tuple(texts)


def _text(parameter: Parameter, context: Context, files: Sequence[Path], source: random.Random) -> str | None:
    """Return the text of a random value; None for the default."""
    if parameter.is_choice:
        options = [text for text in parameter.options(context.session) if not parameter.refusal(context.session, text)]
        return source.choice(options) if options else parameter.default_text or ""
    if parameter.type in (int, float):
        low, high = parameter.arg.ends or (parameter.arg.minimum, parameter.arg.maximum)
        number = source.uniform(*(NUMBERS if low is None or high is None else (low, high)))
        return str(round(number)) if parameter.type is int else f"{number:.3f}"
    if parameter.type is Path:
        # Files that are written get their default name.
        return None if parameter.default_text else source.choice([*map(str, files), "sky", "studio"])
    return source.choice(TEXTS.get(parameter.name, WORDS))
