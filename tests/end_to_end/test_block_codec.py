"""Codec `block` from the command line: encode a folder and a scene with every grouping, decode, describe, refuse."""

import json
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.block.model import block_parts
from ntc.codec.quality import psnr_db
from ntc.metrics.metrics import bits_with_mips
from ntc.pack.file import read_pack
from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.cli.decode import image_file_names
from viewer.scene.images import read_image, write_png

BACKENDS = ("numpy", "torch", "gl")
SIZES = ((96, 64), (64, 64), (40, 24), (100, 36))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four pictures of waves in two categories."""
    place = tmp_path_factory.mktemp("pictures")
    for number, (width, height) in enumerate(SIZES):
        y, x = np.mgrid[0:height, 0:width]
        waves = [np.sin(x * (0.1 + 0.05 * c) + y * 0.07 * (number + 1) + c) for c in range(3)]
        image = np.stack(waves, axis=-1) * 70 + 128
        write_png(place / ("brick", "wood")[number % 2] / f"{number}.png", image.astype(np.uint8))
    return place


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of two textured squares, without packs."""
    return two_squares().write(tmp_path_factory.mktemp("scene") / "scene.glb")


def encode(source: Path, out: Path, *arguments: str) -> int:
    """Exit status of `encode --codec block`."""
    return cli.main(["encode", str(source), "--out", str(out), "--codec", "block", *arguments])


@pytest.mark.parametrize("grouping", ["single", "category", "universal"])
def test_a_folder_in_every_grouping(folder: Path, tmp_path: Path, grouping: str) -> None:
    out = tmp_path / "a.ntc"
    clusters = ("--clusters", "2") if grouping in ("clustered", "random") else ()
    assert encode(folder, out, "--grouping", grouping, "--bits", "4", *clusters) == 0
    pack = read_pack(out)
    assert pack.grouping.name == grouping
    assert len(pack.decoders) == pack.grouping.group_count
    assert pack.training["codec"] == "block"
    assert sorted((texture.width, texture.height) for texture in pack.textures) == sorted(SIZES)
    images = {}
    for backend in BACKENDS:
        assert cli.main(["decode", str(out), "--out", str(tmp_path / backend), "--backend", backend]) == 0
        images[backend] = {path.name: read_image(path).astype(int) for path in (tmp_path / backend).iterdir()}
    for texture, file in zip(pack.textures, image_file_names([t.name for t in pack.textures]), strict=True):
        one = images["numpy"][file]
        assert all(np.abs(one - images[backend][file]).max() <= 1 for backend in BACKENDS)
        original = read_image(folder / f"{texture.name}.png")
        assert texture.psnr_db is not None
        assert psnr_db(one.astype(np.uint8), original) == pytest.approx(texture.psnr_db, abs=1e-6)
        assert texture.psnr_db > 26.0


@pytest.mark.parametrize(
    ("arguments", "codec", "note"),
    [
        ((), "block", ""),
        (("--recipe", "paper", "--epochs", "1"), "grid", ""),
        (("--steps", "3", "--state", "STATE"), "grid", "note: --steps, --state: trains codec grid"),
        (("--codec", "grid", "--steps", "3"), "grid", ""),
    ],
)
def test_the_codec_follows_from_recipe_and_training(
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    codec: str,
    note: str,
) -> None:
    out = tmp_path / "a.ntc"
    words = [str(tmp_path / "a.state") if word == "STATE" else word for word in arguments]
    assert cli.main(["encode", str(folder), "--out", str(out), "--grouping", "single", *words]) == 0
    assert read_pack(out).config.kind == codec
    notes = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note:")]
    assert len(notes) == bool(note)
    assert all(line.startswith(note) for line in notes)


def test_bits_are_met(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = []
    for asked in (3.0, 5.0, 8.0):
        out = tmp_path / f"{asked}.ntc"
        assert encode(folder, out, "--grouping", "single", "--bits", str(asked)) == 0
        pack = read_pack(out)
        came = bits_with_mips(pack)
        printed = capsys.readouterr().out
        assert f"bits: {came:.2f} per texel of mip 0\n" in printed
        assert printed.count(f"target: {asked:g} bits per texel of mip 0") == 1
        # Textures of a few blocks cannot share out the last words.
        assert asked - 0.2 < came <= asked
        stored = sum(t.words.nbytes + t.axes.nbytes + t.mean.nbytes for t in block_parts(pack).textures)
        texels = sum(width * height for width, height in SIZES)
        tables = block_parts(pack).decoders[0].stored_bits(block_parts(pack).config)
        assert came == pytest.approx((8 * stored + tables) / texels)
        found.append(min(t.psnr_db or 0.0 for t in pack.textures))
    assert found[0] < found[1] < found[2]


def test_info_says_what_the_codec_is(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.ntc"
    assert encode(folder, out, "--grouping", "single") == 0
    config = block_parts(read_pack(out)).config
    capsys.readouterr()
    assert cli.main(["info", str(out)]) == 0
    printed = capsys.readouterr().out
    *others, last = map(str, config.block_words)
    sizes = f"codes of {', '.join(others)} or {last} words of 32 bits for {config.mips} mips each"
    assert f"codec block: blocks of 8x8 texels, {sizes}, {config.coefficients} coefficients" in printed
    assert f"{config.coefficients} coefficients, {config.modes} modes, {config.multiply_adds} multiply-adds" in printed
    assert "for codec grid alone" in printed
    assert cli.main(["info", str(out), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["codec"]["kind"] == "block"
    assert content["codec"]["block_side"] == 8
    assert content["certified_error"] is None
