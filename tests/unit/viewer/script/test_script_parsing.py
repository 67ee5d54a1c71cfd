"""A script is read wholly before it is played: what is wrong is one line that names file and line."""

from pathlib import Path

import pytest

from ntc.errors import InputError
from viewer.commands import COMMANDS
from viewer.script.directions import DIRECTIONS
from viewer.script.host import PROPERTIES
from viewer.script.script import LARGEST_SCRIPT, MOST_LINES, parse_exec, parse_script, read_script, split_lines

SCRIPTS_PAGE = Path(__file__).resolve().parents[4] / "docs" / "reference" / "commands.md"


def test_commands_directions_and_comments() -> None:
    script = parse_script(
        "# first\n\ncompare.mode wipe # both\nwait frames 2\n  key Ctrl+P\nsize 320x200\n", "a.script"
    )
    assert [step.where for step in script] == ["a.script:3", "a.script:4", "a.script:5", "a.script:6"]
    assert script[0].words == ("compare.mode", "wipe")


def test_exec_is_split_outside_quotes() -> None:
    assert split_lines("a; b 'c; d' \"e;'\"; f") == ["a", " b 'c; d' \"e;'\"", " f"]
    script = parse_exec("wait frames 1; type 'a; b'\nkey F")
    assert [step.words for step in script] == [("wait", "frames", "1"), ("type", "a; b"), ("key", "F")]
    assert script[-1].where == "--exec:3"


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("compare.mod a", "did you mean compare.mode"),
        ("compare.mode c", "must be one of"),
        ("compare.mode", "lacks mode"),
        ("compare.divider left", "must be a number"),
        ("compare.divider nan", "finite"),
        ("camera.look 1 2 3", "lacks target_x"),
        ("wai frames 1", "did you mean wait"),
        ("wait", "usage: wait"),
        ("wait forever", "wait: must be"),
        ("wait frames 0", "1 to 100000"),
        ("wait frames -1", "1 to 100000"),
        ("wait frames 99999999999999999999", "1 to 100000"),
        ("wait frames ²", "1 to 100000"),
        ("wait seconds nan", "0 to 3600"),
        ("wait seconds 1e9", "0 to 3600"),
        ("size 10x10", "64 to 8192"),
        ("size 1000000x1000000", "64 to 8192"),
        ("size big", "64 to 8192"),
        ("screenshot a.jpg", "end with .png"),
        ("screenshot", "usage: screenshot"),
        ("film a.png", "end with .webp"),
        ("drop", "usage: drop"),
        ("key Ctrl+Nothing", "no such key"),
        ("move 1", "usage: move"),
        ("move 1 nan", "must be a number"),
        ("drag 1 2 3 4 top", "left, right, middle"),
        ("wheel 1000", "-100 to 100"),
        ("expect colour red", "must be one of source"),
        ("expect source", "usage: expect"),
        ("type 'unclosed", "no closing quotation"),
    ],
)
def test_what_is_wrong_names_the_line(line: str, part: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_script(f"wait frames 1\n{line}\n", "a.script")
    message = str(caught.value)
    assert message.startswith("a.script:2: ")
    assert part in message
    assert "\n" not in message


def test_files(tmp_path: Path) -> None:
    file = tmp_path / "a.script"
    file.write_text("wait frames 1\n")
    assert len(read_script(file)) == 1
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"a\.script: is not text"):
        read_script(file)
    file.write_bytes(b"#" * (LARGEST_SCRIPT + 1))
    with pytest.raises(InputError, match="at most"):
        read_script(file)
    file.write_text("#\n" * (MOST_LINES + 1))
    with pytest.raises(InputError, match="10001 lines"):
        read_script(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_script(tmp_path / "missing")
    with pytest.raises(InputError, match="irectory"):
        read_script(tmp_path)


def test_words_of_commands_and_directions_do_not_meet() -> None:
    assert not any("." in name for name in DIRECTIONS)
    assert all("." in command.id for command in COMMANDS)
    assert all(direction.usage.split()[0] == name for name, direction in DIRECTIONS.items())


def test_the_tour_can_be_read_and_the_page_lists_every_property() -> None:
    assert all(f"`{name}`" in SCRIPTS_PAGE.read_text() for name in PROPERTIES)
    assert len(read_script(SCRIPTS_PAGE.parents[1] / "images" / "tour.script")) > 10
