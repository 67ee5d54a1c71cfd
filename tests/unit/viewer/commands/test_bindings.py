"""Keys as text, and the user's keys in the place of the commands' own."""

import pytest

from ntc.errors import InputError
from viewer.commands import COMMANDS, bindings
from viewer.commands.keys import NAMED_KEYS, RESERVED, Chord, parse_chord
from viewer.ui.picture_input import imgui_key


@pytest.mark.parametrize(
    ("text", "chord"),
    [
        ("f", Chord("F")),
        ("F12", Chord("F12")),
        ("ctrl+s", Chord("S", ctrl=True)),
        ("Shift+Ctrl+PageUp", Chord("PageUp", ctrl=True, shift=True)),
        ("?", Chord("/", shift=True)),
        ("Alt+-", Chord("-", alt=True)),
    ],
)
def test_chords(text: str, chord: Chord) -> None:
    assert parse_chord(text) == chord
    assert parse_chord(str(chord)) == chord


@pytest.mark.parametrize("text", ["", "+", "Ctrl+", "Hyper+S", "Ctrl+Ctrl+S", "F13", "SS", "Ctrl", "\u0130", "S+Ctrl"])
def test_what_is_no_key_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match="no such key") as caught:
        parse_chord(text)
    assert "\n" not in str(caught.value)


def test_imgui_knows_every_key() -> None:
    assert len({imgui_key(name) for name in NAMED_KEYS}) == len(NAMED_KEYS)


def test_the_commands_own_keys_are_in_order() -> None:
    bound = bindings({})
    assert bound.problems == ()
    chords = [chord for chords in bound.chords.values() for chord in chords]
    assert len(set(chords)) == len(chords)
    assert not {str(chord) for chord in chords} & set(RESERVED)
    assert set(bound.chords) == {command.id for command in COMMANDS if command.key}


def test_a_key_is_changed_taken_away_and_exchanged() -> None:
    bound = bindings({"camera.frame-all": "Ctrl+Shift+F", "compare.measure": ""})
    assert bound.problems == ()
    assert bound.text("camera.frame-all") == "Ctrl+Shift+F"
    assert bound.text("compare.measure") == ""
    bound = bindings({"camera.frame-all": "M", "compare.measure": "F"})
    assert bound.problems == ()
    assert (bound.text("camera.frame-all"), bound.text("compare.measure")) == ("M", "F")


def test_a_command_without_a_key_gets_one() -> None:
    assert bindings({"camera.go": "Ctrl+G"}).text("camera.go") == "Ctrl+G"


@pytest.mark.parametrize(
    ("keys", "parts"),
    [
        ({"camera.frame-all": "M"}, ("camera.frame-all", "M", "compare.measure")),
        ({"camera.go": "Ctrl+G", "camera.look": "Ctrl+G"}, ("camera.look", "Ctrl+G", "camera.go")),
        ({"camera.frame-all": "Space"}, ("camera.frame-all", "showing the other slot")),
        ({"camera.frame-all": "W"}, ("camera.frame-all", "flying")),
        ({"camera.frame-all": "Nonsense"}, ("camera.frame-all", "no such key")),
        ({"camera.no-such": "Ctrl+G"}, ("camera.no-such", "no command")),
    ],
)
def test_what_is_refused_keeps_its_own_key(keys: dict[str, str], parts: tuple[str, ...]) -> None:
    bound = bindings(keys)
    (problem,) = bound.problems
    assert all(part in problem for part in parts)
    assert bound.text("camera.frame-all") == "F"
    assert bound.text("compare.measure") == "M"


def test_a_refusal_that_leads_to_another_one() -> None:
    # The second is refused for the first, which then is in the way of a third.
    bound = bindings({"camera.frame-all": "M", "camera.next": "F"})
    assert len(bound.problems) == 2
    assert (bound.text("camera.frame-all"), bound.text("camera.next")) == ("F", "C")
