"""The command line of the design page is read as written, and bad arguments become one line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import tyro

import viewer
from lab.commands import STUDIES
from lab.commands import SUBCOMMANDS as LAB_COMMANDS
from ntc.errors import InputError
from viewer import cli
from viewer.cli.arguments import parse_arguments
from viewer.cli.help_groups import GROUPS
from viewer.cli.options import SUBCOMMANDS, InfoOptions, RenderOptions, ViewOptions
from viewer.cli.render import chosen_lighting


def options_of(arguments: Sequence[str]) -> Any:
    """The options that `arguments` are parsed to."""
    return parse_arguments(arguments)[1]


def test_view_is_the_default_subcommand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert options_of([]) == ViewOptions()
    expected = ViewOptions(scene=Path("street.glb"), grouping="single", path="forward")
    assert options_of(["street.glb", "--grouping", "single", "--path", "forward"]) == expected
    assert options_of(["view", "street.glb", "--grouping", "single", "--path", "forward"]) == expected
    # A file and a built-in scene are no mistyped commands.
    monkeypatch.chdir(tmp_path)
    Path("rendr").write_text("")
    for scene in ("rendr", "gallery", "street.glb", "./street", "street2"):
        assert options_of([scene]) == ViewOptions(scene=Path(scene))


@pytest.mark.parametrize(
    "arguments",
    [
        ["render", "a.glb", "--out", "o", "--pack", "x.ntc", "y.ntc"],
        ["render", "--out", "o", "--pack", "x.ntc", "--pack", "y.ntc", "a.glb"],
        ["render", "--pack", "x.ntc", "y.ntc", "a.glb", "--out", "o"],
    ],
)
def test_packs_and_scene_in_any_order(arguments: list[str]) -> None:
    options = options_of(arguments)
    assert isinstance(options, RenderOptions)
    assert options.scene == Path("a.glb")
    assert options.pack == (Path("x.ntc"), Path("y.ntc"))


def words(line: str) -> list[str]:
    return line.split()


def test_render_takes_what_the_design_lists() -> None:
    options = options_of(
        words(
            "render a.gltf --out o --grouping clustered --path forward --precision fp16 --size 64x48"
            " --eye 1 -2 3 --target 0 0 0 --fov 45 --overlay divergence --require-gpu"
        ),
    )
    assert options == RenderOptions(
        out=Path("o"),
        scene=Path("a.gltf"),
        grouping="clustered",
        path="forward",
        precision="fp16",
        size=(64, 48),
        eye=(1.0, -2.0, 3.0),
        target=(0.0, 0.0, 0.0),
        fov=45.0,
        overlay="divergence",
        require_gpu=True,
    )


@pytest.mark.parametrize(("azimuth", "turned"), [("0", 0.0), ("359.5", 359.5), ("400", 40.0), ("-90", 270.0)])
def test_the_sun_may_be_turned_more_than_once(azimuth: str, turned: float) -> None:
    lighting = chosen_lighting(options_of(["render", "--out", "o", "--sun", azimuth, "30"]))
    assert (lighting.sun_azimuth, lighting.sun_elevation) == (turned, 30.0)
    with pytest.raises(InputError, match="sun azimuth nan"):
        chosen_lighting(options_of(["render", "--out", "o", "--sun", "nan", "30"]))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("render --out {out} --bogus 3", "--bogus"),
        ("render --out {out} --size 10", "--size"),
        ("render --out {out} --size 0x5", "--size"),
        ("render --out {out} --precision fp8", "--precision"),
        ("render", "--out"),
        ("render --out {out} --eye 1 2", "--eye"),
        ("encode s.glb --out {out}.ntc --grouping nonsense", "--grouping"),
        ("encode", "Missing from ntc-viewer encode: SCENE|FOLDER|LIST"),
        ("render missing.glb --out {out}", "missing.glb"),
        ("render gallery --out {out} --pack missing.ntc", "missing.ntc"),
        ("render gallery --out {out} --grouping nonsense", "nonsense"),
        ("render gallery --out {out} --camera nowhere", "nowhere"),
        ("render gallery --out {out} --eye 0 0 0", "--target"),
        ("render gallery --out {out} --eye 0 0 0 --target 0 0 0", "--target"),
        ("render gallery --out {out} --eye 0 0 0 --target 0 0 1 --fov 180", "--fov"),
        ("render gallery --out {out} --cameras missing.json", "missing.json"),
        ("encode missing.glb --out {out}.ntc", "missing.glb"),
        ("encode missing.glb --out {out}.png", ".ntc"),
        ("encode missing.glb --out {out}.ntc --steps 0", "--steps"),
        ("decode missing.ntc --out {out}", "missing.ntc"),
        ("info missing.ntc", "missing.ntc"),
        ("info missing.glb", "missing.glb"),
    ],
)
def test_bad_arguments_and_input_are_one_line_and_leave_nothing_behind(
    arguments: str, named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(arguments.format(out=tmp_path / "out").split()) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ")
    assert captured.err.count("\n") == 1
    assert named in captured.err
    assert captured.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        "view --out {typo}/pictures --headless",
        "render --out {typo}/picture",
        "encode gallery --out {typo}/x.ntc",
        "encode gallery --out {there}/x.ntc --state {typo}/state",
        "decode x.ntc --out {typo}/images",
        "export --out {typo}/x.glb",
        "export --web {typo}/page",
        "library extract library --out {typo}/x.ntc",
        "bench --json {typo}/x.json",
        "--tyro-write-completion bash {typo}/ntc-viewer",
    ],
)
def test_an_output_in_a_folder_that_does_not_exist_makes_none(
    arguments: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(arguments.format(typo=tmp_path / "typo", there=tmp_path).split()) == 2
    printed = capsys.readouterr().err
    assert f"the folder {tmp_path / 'typo'} does not exist; create it first" in printed
    assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("word", "remedy"),
    [
        ("rendr", "did you mean render?"),
        ("Encode", "did you mean encode?"),
        ("stduy", "did you mean study?"),
        ("xylophone", "choose study, view, render, encode"),
    ],
)
def test_a_mistyped_command_is_told_apart_from_a_file(word: str, remedy: str) -> None:
    with pytest.raises(InputError, match="no such command") as error:
        parse_arguments([word, "scene.glb"])
    assert remedy in str(error.value)


def test_version_and_that_help_tells_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        parse_arguments(["--version"])
    assert stopped.value.code == 0
    assert capsys.readouterr().out == f"ntc-viewer {viewer.__version__}\n"
    with pytest.raises(SystemExit):
        parse_arguments(["--help"])
    printed = capsys.readouterr().out
    assert "--version" in printed
    assert "--tyro-write-completion" in printed


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_of_every_shell_knows_the_commands(shell: str, tmp_path: Path) -> None:
    file = tmp_path / "completion"
    with pytest.raises(SystemExit) as stopped:
        parse_arguments(["--tyro-write-completion", shell, str(file)])
    assert stopped.value.code in (0, None)
    assert all(word in file.read_text() for word in ("encode", "render", "bench"))


@pytest.mark.parametrize("words", [["csh", "file"], ["bash"], []])
def test_completion_of_an_unknown_shell_is_refused(words: list[str]) -> None:
    with pytest.raises(InputError, match=r"bash\|zsh\|fish FILE"):
        parse_arguments(["--tyro-write-completion", *words])


def test_without_the_package_lab_only_its_commands_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert options_of(["info", "f.ntc"]) == InfoOptions(file=Path("f.ntc"))
    with pytest.raises(InputError, match="study clusters: no such study"):
        parse_arguments(["study", "clusters", "--out", "o"])


def help_of(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    """The lines of the help that `words` print."""
    with pytest.raises(SystemExit):
        parse_arguments(words)
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("command", GROUPS)
def test_first_help_explains_the_usual_options_and_names_all(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = help_of(capsys, *command.split(), "--help")
    everything = help_of(capsys, *command.split(), "--help-all")
    usual, *others = GROUPS[command]
    assert len(lines) <= 55
    assert [line for line in lines if len(line) > 80] == []
    assert (others == []) == (lines == everything)
    text = "\n".join(lines)
    assert all(f"--{option}" in text for group in GROUPS[command] for option in group.options)
    assert all(f"Example: ntc-viewer {example}" in text for example in usual.examples)
    # No option is forgotten.
    (options,) = (
        each.options for each in (*SUBCOMMANDS, *LAB_COMMANDS, *STUDIES) if each.name == command.rsplit(maxsplit=1)[-1]
    )
    hints = get_type_hints(options, include_extras=True).items()
    fields = {name for name, hint in hints if tyro.conf.Positional not in getattr(hint, "__metadata__", ())}
    written = {"as" if name == "image_format" else name.replace("_", "-") for name in fields}
    assert written == {option for group in GROUPS[command] for option in group.options}
