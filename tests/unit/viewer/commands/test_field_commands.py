"""Fields of the session that have a `Setting`: each has a command that sets it, and nothing else."""

from collections.abc import Iterator
from dataclasses import is_dataclass
from operator import attrgetter
from typing import Any, get_args, get_type_hints

import pytest

from ntc.errors import InputError
from tests.support.spoilt_files import open_context, write_scene
from viewer.commands import NEXT, find_command, run_line
from viewer.commands.command import Context, typed
from viewer.state.session import Session
from viewer.state.setting import Setting


def described(kind: Any = Session, path: str = "") -> Iterator[tuple[str, Setting]]:
    """(path, description) of each field of the session that has one."""
    for name, hint in get_type_hints(kind, include_extras=True).items():
        of_field = [each for each in get_args(hint) if isinstance(each, Setting)]
        if of_field:
            yield f"{path}{name}", of_field[0]
        elif is_dataclass(hint) and f"{path}{name}" not in ("scene", "view.slot_b", "settings.overlay"):
            yield from described(hint, f"{path}{name}.")


FIELDS = dict(described())


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Context:
    return open_context(write_scene(tmp_path_factory.mktemp("fields")))


@pytest.mark.parametrize("path", FIELDS)
def test_its_command_sets_the_field(context: Context, path: str) -> None:
    command, session = find_command(FIELDS[path].command), context.session
    if command.why_not(context):
        return
    side = ("a",) if "slot_a" in path else ()
    assert command.current is not None
    before = attrgetter(path)(session)
    assert command.current(session, *side) == before
    if FIELDS[path].toggles:
        run_line(context, command.id)
        assert attrgetter(path)(session) is not before
        return
    parameter = command.parameters[-1]
    assert parameter.arg.help
    texts = list(parameter.fixed) or [typed(parameter.arg.minimum), typed(0.7 * (parameter.arg.maximum or 1.0))]
    for text in texts:
        run_line(context, " ".join((command.id, *side, text)))
        assert attrgetter(path)(session) == parameter.parse(text)
    if parameter.fixed or not (parameter.arg.clamp or parameter.arg.wraps):
        with pytest.raises(InputError, match="must be"):
            run_line(context, " ".join((command.id, *side, "1e9")))


def test_an_angle_is_taken_modulo_a_turn_and_the_height_of_the_sun_stays_in_its_range(context: Context) -> None:
    run_line(context, "light.sun 370 200")
    lighting = context.session.view.lighting
    assert (lighting.sun_azimuth, lighting.sun_elevation) == (10.0, 90.0)
    run_line(context, "light.turn -90")
    assert context.session.view.lighting.environment_turn == 270.0


@pytest.mark.parametrize(("of", "command_id"), NEXT.items())
def test_a_command_goes_through_all_choices(context: Context, of: str, command_id: str) -> None:
    command, session = find_command(of), context.session
    assert command.current is not None
    seen = []
    for _ in command.parameters[0].fixed:
        run_line(context, command_id)
        seen.append(command.current(session))
    assert sorted(seen) == sorted(command.parameters[0].fixed)
