"""Files are written whole or not at all, and what killed writers leave goes away."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from ntc.errors import InputError
from ntc.io import atomic_path, is_partial, read_file, write_bytes
from tests.support.killed_writes import kill_writers


def test_a_write_replaces_the_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    write_bytes(path, b"old")
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_the_temporary_file_is_recognised_and_keeps_the_suffix(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "a.png") as temporary:
        assert temporary.suffix == ".png"
        assert is_partial(temporary)
        temporary.write_bytes(b"x")
    assert not is_partial(tmp_path / "a.png")


def test_a_long_name_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 240 + ".ntc")
    write_bytes(path, b"x")
    assert path.read_bytes() == b"x"


def test_leftovers_of_the_same_file_are_removed_and_no_others(tmp_path: Path) -> None:
    (tmp_path / ".a.x1.partial.ntc").write_bytes(b"half")
    (tmp_path / ".b.x1.partial.ntc").write_bytes(b"half of another")
    (tmp_path / ".a.ntc").write_bytes(b"somebody's file")
    write_bytes(tmp_path / "a.ntc", b"whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".a.ntc", ".b.x1.partial.ntc", "a.ntc"]


def test_a_file_that_is_being_written_is_no_leftover(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "a.ntc") as first:
        first.write_bytes(b"first")
        write_bytes(tmp_path / "a.ntc", b"second")
        assert first.exists()
    assert (tmp_path / "a.ntc").read_bytes() == b"first"


def test_a_full_disk_gives_one_line_and_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    write_bytes(path, b"old")
    program = (
        "import resource, signal, sys; from pathlib import Path; from ntc.io import write_bytes;"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000));"
        "write_bytes(Path(sys.argv[1]), bytes(5000))"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "a.ntc: cannot be written (File too large); check space and permissions" in done.stderr
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_disk_that_fills_while_writing_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    with pytest.raises(InputError, match="No space left on device"), atomic_path(path), open("/dev/full", "wb", 0) as f:  # noqa: PTH123
        f.write(b"x")
    assert list(tmp_path.iterdir()) == []


def test_a_killed_writer_damages_nothing(tmp_path: Path) -> None:
    assert kill_writers(tmp_path / "pack.ntc", kills=6, seed=1) == (0, 0)


def test_only_regular_files_of_bounded_length_are_read(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert read_file(tmp_path / "a") == b"12345"
    with pytest.raises(OSError, match="5 bytes, at most 4"):
        read_file(tmp_path / "a", 4)
    with pytest.raises(IsADirectoryError):
        read_file(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="no regular file"):
        read_file(tmp_path / "pipe")
    with pytest.raises(OSError, match="no regular file"):
        read_file(Path("/dev/zero"))


def test_a_file_of_holes_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(OSError, match="at most"):
        read_file(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 16


def test_messages_hold_nothing_that_a_terminal_acts_on() -> None:
    assert str(InputError("a\x1b[2J\nb \ud800 é")) == "a?[2J b ? é"
