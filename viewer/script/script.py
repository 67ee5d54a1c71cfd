"""Scripts: parsing and playing. All lines are parsed before the first is played. A generator plays them, and yields to each frame."""

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ntc.errors import InputError
from ntc.io import read_file
from viewer.commands import COMMANDS, find_command, run
from viewer.commands.command import words
from viewer.script.directions import DIRECTIONS, Play, opened
from viewer.script.host import ScriptHost, Turn
from viewer.state.event_handlers import notify

LARGEST_SCRIPT = 1 << 20
"""Largest script file in bytes."""
MOST_LINES = 10_000


@dataclass(frozen=True)
class Step:
    """Line of a script."""

    where: str
    """File and line for messages."""
    words: tuple[str, ...]
    play: Play

    @property
    def expects_message(self) -> bool:
        """True for a line that checks messages; the line before it may cause an error message."""
        return self.words[:2] == ("expect", "toast")


Script = tuple[Step, ...]


def _command(command_id: str, arguments: Sequence[str]) -> Play:
    values = find_command(command_id).parse(arguments)

    def play(host: ScriptHost) -> Iterator[Turn]:
        run(host.context, command_id, *values)
        yield from opened(host)

    return play


def _play(parts: Sequence[str]) -> Play:
    name, arguments = parts[0], tuple(parts[1:])
    if "." in name:
        return _command(name, arguments)
    direction = DIRECTIONS.get(name)
    if direction is None:
        near = difflib.get_close_matches(name, [*DIRECTIONS, *(command.id for command in COMMANDS)])
        raise InputError(
            f"{name[:60]!r}: no such command or direction" + (f"; did you mean {near[0]}?" if near else "")
        )
    if not direction.fewest <= len(arguments) <= direction.most:
        raise InputError(f"usage: {direction.usage}")
    try:
        return direction.read(arguments)
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(name) else f"{name}: {error}") from error


def _steps(lines: Sequence[str], name: str) -> Script:
    if len(lines) > MOST_LINES:
        raise InputError(f"{name}: has {len(lines)} lines, at most {MOST_LINES} are read")
    steps: list[Step] = []
    for number, line in enumerate(lines, 1):
        where = f"{name}:{number}"
        try:
            parts = tuple(words(line))
            if parts:
                steps.append(Step(where, parts, _play(parts)))
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
    return tuple(steps)


def parse_script(text: str, name: str) -> Script:
    """Return the steps of a script called `name`, one for each line. Raises InputError that names the line."""
    return _steps(text.splitlines(), name)


def read_script(path: Path) -> Script:
    """Read the script in a file. Raises InputError."""
    try:
        text = read_file(path, LARGEST_SCRIPT).decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text ({error.reason})") from error
    return parse_script(text, str(path))


def split_lines(text: str) -> list[str]:
    """Split a text at the semicolons outside quotes."""
    parts, quote = [""], ""
    for letter in text:
        if letter == ";" and not quote:
            parts.append("")
            continue
        if letter in "'\"" and quote in ("", letter):
            quote = "" if quote else letter
        parts[-1] += letter
    return parts


def parse_exec(text: str) -> Script:
    """Return the script of the option --exec, whose lines are separated by semicolons. Raises InputError."""
    return _steps(split_lines(text.replace("\n", ";")), "--exec")


def play_script(script: Script, host: ScriptHost) -> Iterator[Turn]:
    """Play `script` on `host` until its end or until a command closes the window. Yields for each frame and while it waits.

    Raises InputError with file and line where a line fails, where an expectation does not hold, and where the window shows an error
    message that the next line does not check.
    """
    for step, following in zip(script, (*script[1:], None), strict=True):
        known = _errors(host)
        try:
            yield from step.play(host)
        except InputError as error:
            if following is None or not following.expects_message:
                raise InputError(f"{step.where}: {error}") from error
            notify(host.session, str(error), "error")
            yield "frame"
        new = [text for text in _errors(host) if text not in known]
        if new and not (following is not None and following.expects_message):
            raise InputError(f"{step.where}: {new[0]}")
        if host.is_closing:
            return


def _errors(host: ScriptHost) -> list[str]:
    return [toast.text for toast in host.session.window.toasts if toast.kind == "error"]
