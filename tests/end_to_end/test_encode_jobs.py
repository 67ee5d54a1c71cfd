"""`encode` by jobs: processes of this machine, one of which is killed; a pack of many jobs; what is missing; what is refused."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from ntc.pack.file import read_pack
from viewer import cli
from viewer.encoding import whole_run as plan
from viewer.scene.images import write_png

TEXTURES = 12


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures in three categories."""
    place = tmp_path_factory.mktemp("pictures")
    y, x = np.mgrid[0:40, 0:40]
    for number in range(TEXTURES):
        noise = np.random.default_rng(number).normal(0, 20.0, (40, 40, 3))
        waves = np.stack([np.sin(x * 0.1 * number + y * 0.05 + c) for c in range(3)], axis=-1) * 50 + 128
        path = place / ("wood", "<b>stone", "grass")[number % 3] / f"{number}.png"
        path.parent.mkdir(exist_ok=True)
        write_png(path, np.clip(waves + noise, 0, 255).astype(np.uint8))
    return place


def encode(source: Path, out: Path, *arguments: str) -> int:
    """Exit status of `encode`."""
    return cli.main(["encode", str(source), "--out", str(out), *arguments])


def kill_a_worker() -> None:
    """Kill the first worker that has begun, as a machine does that runs out of memory."""
    for _ in range(2000):
        workers = [process for process in multiprocessing.active_children() if process.name == "ntc-helper"]
        if workers and workers[0].pid is not None:
            os.kill(workers[0].pid, signal.SIGKILL)
            return
        time.sleep(0.005)


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_two_workers_of_which_one_is_killed_do_as_one_does(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plan, "MOST_TEXTURES", 3)
    one, two = tmp_path / "one.ntc", tmp_path / "two.ntc"
    assert encode(folder, one, "--workers", "1", "--grouping", "baseline") == 0
    killer = threading.Thread(target=kill_a_worker)
    killer.start()
    assert encode(folder, two, "--workers", "2", "--grouping", "baseline") == 0
    killer.join()
    assert one.read_bytes() == two.read_bytes()
    printed = capsys.readouterr()
    assert "the worker gave no answer" in printed.err
    assert f"{TEXTURES} textures: {TEXTURES} encoded in" in printed.out
    assert len(read_pack(one).decoders) == TEXTURES
    names = [texture.name for texture in read_pack(one).textures]
    assert names == sorted(path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.png"))
    assert {line.split()[0] for line in printed.out.splitlines()} >= {"<b>stone", "grass", "wood", "all"}
    assert not (tmp_path / "two.ntc.jobs").exists()


@pytest.mark.process
@pytest.mark.slow
def test_a_library_keeps_what_can_be_read_and_names_the_rest(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = tmp_path / "list.txt"
    (tmp_path / "torn.png").write_bytes(next(folder.rglob("*.png")).read_bytes()[:500])
    listed.write_text("\n".join([*map(str, sorted(folder.rglob("*.png"))[:4]), "torn.png"]))
    library = tmp_path / "library"
    assert encode(listed, library, "--workers", "1", "--grouping", "universal") == 1
    printed = capsys.readouterr().out
    assert "5 textures: 4 encoded in" in printed
    assert printed.count("failed: ") == 1
    assert "torn.png: the image does not decode" in printed
    before = {path: path.stat().st_mtime_ns for path in library.glob("*.ntc")}
    (tmp_path / "torn.png").unlink()
    listed.write_text("\n".join(map(str, sorted(folder.rglob("*.png"))[:4])))
    assert encode(listed, library, "--grouping", "universal") == 0
    assert "4 textures: 0 encoded in" in capsys.readouterr().out
    assert before == {path: path.stat().st_mtime_ns for path in library.glob("*.ntc")}


def test_ctrl_c_keeps_what_is_done(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("viewer.cli.encode.deferred_interrupt", lambda: nullcontext(lambda: True))
    assert encode(folder, tmp_path / "a.ntc", "--workers", "1", "--grouping", "universal") == 130
    assert "0 textures saved in" in capsys.readouterr().err
    assert (tmp_path / "a.ntc.jobs").is_dir()
    assert not (tmp_path / "a.ntc").exists()
