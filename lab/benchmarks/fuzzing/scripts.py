"""Scripts, their commands and saved views for the fuzzer."""

import random

from lab.benchmarks.fuzzing.mutators import Mutate
from ntc.errors import InputError
from tests.support.scenes import REACHING_OUT, example_view
from viewer.commands import COMMANDS, run_line
from viewer.commands.command import Context
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.script.directions import DIRECTIONS
from viewer.script.script import parse_script
from viewer.state.open_files import InitialView, new_session
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings
from viewer.state.view_file import parse_view, view_json

NUMBERS = ("0", "1", "-1", "0.5", "1e400", "nan", "-inf", "99999999999", "0x10", "\u0661", "")
MOST_LINES = 40


def example_session() -> Session:
    """The built-in scene without packs, as it opens."""
    return new_session(load_scene(assets_folder() / "courtyard.glb"), {}, ViewerSettings(), InitialView())


class ScriptReader:
    """Reads scripts, and runs those of their commands that stay in the session."""

    def __init__(self) -> None:
        session = example_session()
        self._scene = session.scene
        self._saved = example_view(session)

    def script(self, data: bytes) -> None:
        """Take `data` as a script. Raises InputError."""
        text = data.decode(errors="replace")
        context = Context(new_session(self._scene, {}, ViewerSettings(), InitialView()))
        for line in text.splitlines()[:MOST_LINES]:
            if line.split()[:1] and not line.split()[0].startswith(REACHING_OUT):
                try:
                    run_line(context, line)
                except InputError as error:
                    _require_one_line(error)
        context.training.close()
        parse_script(text, "fuzz")

    def view(self, data: bytes) -> None:
        """Take `data` as a saved view. Raises InputError."""
        parse_view(data.decode(errors="replace"), "fuzz", self._saved)


def _require_one_line(error: InputError) -> None:
    if not str(error).isprintable():
        raise AssertionError(f"not one printable line: {str(error)[:200]!r}") from error


def view_seed() -> bytes:
    """A saved view."""
    return view_json(example_view(example_session())).encode()


def script_seed() -> bytes:
    """Every command and direction once, with arguments that some of them take."""
    lines = [f"{command.id} {' '.join(p.default_text or 'a' for p in command.parameters)}" for command in COMMANDS]
    return "\n".join([*lines, *DIRECTIONS]).encode()


def mutate_script(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """`data` with a line or a word of it exchanged."""
    lines = data.decode(errors="replace").splitlines() or [""]
    number = source.randrange(len(lines))
    words = [*(command.id for command in COMMANDS), *DIRECTIONS, *NUMBERS]
    match source.randrange(4):
        case 0:
            lines.insert(number, source.choice(lines))
        case 1:
            del lines[number]
        case 2:
            lines[number] = mutate(lines[number].encode(), 200).decode(errors="replace")
        case _:
            parts = lines[number].split(" ")
            parts[source.randrange(len(parts))] = source.choice(words)
            lines[number] = " ".join(parts)
    return "\n".join(lines[: 2 * MOST_LINES]).encode()[:limit]
