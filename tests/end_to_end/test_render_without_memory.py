"""`render` on a GPU without memory."""

from pathlib import Path

import pytest

from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.gl.allocation import LIMIT_VARIABLE
from viewer.state.view_state import REFERENCE


@pytest.mark.parametrize(
    ("megabytes", "size", "words"),
    [
        ("0", "64x64", ("vertices of", "the GPU has no memory for")),
        ("1", "2000x1000", ("visibility buffer 2000x1000", "the GPU has no memory for 32 MB")),
        ("much", "64x64", (LIMIT_VARIABLE, "must be a whole number of MB")),
    ],
)
def test_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    megabytes: str,
    size: str,
    words: tuple[str, ...],
) -> None:
    path = two_squares().write(tmp_path / "scene.glb")
    monkeypatch.setenv(LIMIT_VARIABLE, megabytes)
    arguments = ["render", str(path), "--grouping", REFERENCE, "--size", size, "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.strip().count("\n") == 0
    assert all(word in error for word in words), error
    assert not (tmp_path / "out").exists()
