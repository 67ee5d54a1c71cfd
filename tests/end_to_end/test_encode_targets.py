"""What `encode` is asked to come to: a quality, a size, a preset; what it prints of it; what it refuses; Ctrl-C."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from ntc.metrics.metrics import bits_with_mips
from ntc.pack.file import read_pack
from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.cli.encode import screen_weights
from viewer.scene.images import write_png


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A smooth picture and seven rough ones."""
    place = tmp_path_factory.mktemp("pictures")
    y, x = np.mgrid[0:64, 0:64]
    waves = np.stack([np.sin(x * 0.1 + y * 0.05 + c) for c in range(3)], axis=-1) * 50 + 128
    for number in range(8):
        noise = np.random.default_rng(number).normal(0, 40.0 if number else 1.0, waves.shape)
        write_png(place / f"{number}.png", np.clip(waves + noise, 0, 255).astype(np.uint8))
    return place


def encode(source: Path, out: Path, *arguments: str) -> int:
    """Exit status of `encode`."""
    return cli.main(["encode", str(source), "--out", str(out), "--grouping", "single", *arguments])


def test_a_quality_says_who_has_it(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.ntc"
    assert encode(folder, out, "--quality", "25") == 0
    assert "quality: 8 of 8 textures have at least 25 dB, as asked" in capsys.readouterr().out
    assert all((texture.psnr_db or 0.0) >= 25.0 for texture in read_pack(out).textures)
    assert encode(folder, out, "--quality", "55", "--levels", "1") == 0
    printed = capsys.readouterr().out
    short = [texture for texture in read_pack(out).textures if (texture.psnr_db or 0.0) < 55.0]
    assert len(short) >= 7
    assert f"quality: {8 - len(short)} of 8 textures have at least 55 dB" in printed
    (line,) = [line for line in printed.splitlines() if line.startswith("not reached: ")]
    assert line.count(" dB)") == 5
    assert line.endswith(f" and {len(short) - 5} more")


def test_a_size_and_a_preset_say_what_came(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.ntc"
    assert encode(folder, out, "--size", "0.05") == 0
    assert f"file: {out.stat().st_size / 1e6:.3f} MB, asked for at most 0.05" in capsys.readouterr().out
    assert out.stat().st_size <= 50_000
    assert encode(folder, out, "--preset", "fast") == 0
    pack = read_pack(out)
    assert pack.config.multiply_adds <= 100
    printed = capsys.readouterr().out
    figures = [line for line in printed.splitlines() if "bits" in line and not line.startswith(("codec ", "target: "))]
    assert figures == [f"bits: {bits_with_mips(pack):.2f} per texel of mip 0"]
    assert "target: 2 bits per texel of mip 0" in printed
    assert "codec block: blocks of 4x4 texels, codes of 1 word of 32 bits" in printed


def test_views_share_out_a_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = two_squares().write(tmp_path / "scene.glb")
    views = tmp_path / "views.json"
    views.write_text(json.dumps([{"name": "a", "eye": [0, 0, 3], "target": [0, 0, 0], "fov": 60}]))
    out = tmp_path / "a.ntc"
    assert encode(scene, out, "--size", "0.02", "--views", str(views)) == 0
    assert out.stat().st_size <= 20_000
    assert "asked for at most 0.02" in capsys.readouterr().out


def test_worth_is_pixels_by_texel() -> None:
    view = np.full((10, 10), -1, np.int32)
    view[:4], view[4:6] = 0, 1
    worth = screen_weights([view, view], [40, 40, 40])
    assert worth[0] == pytest.approx(2.0 * worth[1])
    assert worth[0] == pytest.approx(2.0)
    # What nobody sees is not given up.
    assert worth[2] == pytest.approx(0.1)
    assert screen_weights([], [40, 40]) == (0.1, 0.1)


def interrupted_at(question: int, asked: list[bool]) -> Callable[[], object]:
    """Stands for `deferred_interrupt`: Ctrl-C is pressed before the question of that number. `asked` counts questions."""

    @contextmanager
    def interrupt() -> Iterator[Callable[[], bool]]:

        def pressed() -> bool:
            asked.append(True)
            return len(asked) >= question

        yield pressed

    return interrupt


def test_ctrl_c_keeps_nothing_before_all_are_encoded_and_everything_after(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, asked = tmp_path / "a.ntc", list[bool]()
    for question in (1, 4):
        monkeypatch.setattr("viewer.cli.encode.deferred_interrupt", interrupted_at(question, []))
        assert encode(folder, out, "--quality", "25") == 130
        assert not out.exists()
    monkeypatch.setattr("viewer.cli.encode.deferred_interrupt", interrupted_at(10**9, asked))
    assert encode(folder, out, "--quality", "25") == 0
    out.unlink()
    # The last question but one is asked while textures are corrected, the last one when the pack is there.
    monkeypatch.setattr("viewer.cli.encode.deferred_interrupt", interrupted_at(len(asked) - 1, []))
    assert encode(folder, out, "--quality", "25") == 0
    assert "note: stopped by Ctrl-C" in capsys.readouterr().err
    assert len(read_pack(out).textures) == 8
