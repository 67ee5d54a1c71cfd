"""A codec that the registry gets from tests: encoded, told about, decoded, rendered and exported by commands, in this process."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ntc.pack.file import read_pack
from tests.end_to_end.conftest import two_squares
from tests.end_to_end.export.test_shader import Compared, exported, reference_program, run_program
from tests.support.two_colors import NAME, registered
from viewer import cli
from viewer.cli.encode import encode
from viewer.cli.options import EncodeOptions
from viewer.scene.images import read_image


@pytest.fixture(scope="module", autouse=True)
def codec() -> Iterator[None]:
    with registered():
        yield


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """scene.glb, and scene.baseline.ntc beside it."""
    path = two_squares().write(tmp_path_factory.mktemp("scene") / "scene.glb")
    # The command line's own list of codecs is fixed.
    options = EncodeOptions(path, out=path.with_name("scene.baseline.ntc"), grouping="baseline", codec=NAME)  # type: ignore[arg-type]
    assert encode(options) == 0
    return path


def test_it_is_told_about_and_decoded_the_same_by_all(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pack = str(scene.with_name("scene.baseline.ntc"))
    capsys.readouterr()
    assert cli.main(["info", pack, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["codec"]["kind"] == NAME
    assert cli.main(["info", pack]) == 0
    assert "the codec has none" in capsys.readouterr().out
    images = []
    for backend in ("numpy", "torch", "gl"):
        assert cli.main(["decode", pack, "--out", str(tmp_path / backend), "--backend", backend]) == 0
        images.append(np.stack([read_image(path) for path in sorted((tmp_path / backend).glob("*.png"))]).astype(int))
    assert max(np.abs(image - images[0]).max() for image in images) <= 1
    command = ["render", str(scene), "--out", str(tmp_path / "r"), "--grouping", "baseline", "--size", "64x48"]
    assert cli.main(command) == 0
    assert json.loads((tmp_path / "r" / "stats.json").read_text())["psnr_db"] > 25.0


@pytest.mark.process
@pytest.mark.guards("exports")
def test_the_exported_program_decodes_what_the_reference_does(scene: Path, tmp_path: Path) -> None:
    compared = Compared.of(read_pack(scene.with_name("scene.baseline.ntc")), 5000)
    own = exported(compared.pack, tmp_path, "glsl")
    found = run_program(reference_program(own.folder), own.folder / "ntc_pack.bin", "base", compared.requests["base"])
    compared.check("base", found)
