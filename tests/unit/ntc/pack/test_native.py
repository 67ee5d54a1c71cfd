"""ntc.decode by libntc: within one step of the float64 reference, and numpy where it is not there."""

from pathlib import Path

import numpy as np
import pytest

import ntc
from ntc.c import library as built
from ntc.pack import native
from tests.conformance.native import library
from tests.conformance.packs import FOLDER, MAKERS


@pytest.fixture
def _libntc(monkeypatch: pytest.MonkeyPatch) -> None:
    """libntc of the source as it is, wherever it was built."""
    compiled = library()
    monkeypatch.setattr(native, "library", lambda: compiled)


@pytest.mark.usefixtures("_libntc")
@pytest.mark.parametrize("name", sorted(MAKERS))
def test_decode_is_within_one_step_of_the_reference(name: str) -> None:
    pack = ntc.read_pack(FOLDER / f"{name}.ntc")
    for number in range(len(pack.textures)):
        for level in range(ntc.mip_count(pack, number)):
            found, wanted = (ntc.decode(pack, number, level, backend) for backend in ("libntc", "numpy"))
            assert found.shape == wanted.shape
            assert np.abs(found.astype(int) - wanted).max() <= 1


def test_without_libntc_numpy_decodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "library", lambda: None)
    pack = ntc.read_pack(FOLDER / "grid-one-mip.ntc")
    np.testing.assert_array_equal(ntc.decode(pack, 0), ntc.decode(pack, 0, backend="numpy"))
    with pytest.raises(ntc.InputError, match="libntc was not built"):
        ntc.decode(pack, 0, backend="libntc")


def test_a_machine_without_a_compiler_builds_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ntc.h", "ntc.c"):
        (tmp_path / name).write_bytes((built.FOLDER / name).read_bytes())
    monkeypatch.setattr(built, "FOLDER", tmp_path)
    monkeypatch.setenv("CC", "no-such-compiler")
    assert built.build() is None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ntc.c", "ntc.h"]
