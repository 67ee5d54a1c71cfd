"""`.ntc` files of other programs are told apart by content, and named; NVIDIA's tell what is in them."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.other_formats import other_format, read_ntex
from viewer import cli

DESCRIPTION: dict[str, Any] = {
    "schemaVersion": 1,
    "width": 512,
    "height": 256,
    "numColorMips": 10,
    "numChannels": 5,
    "textures": [
        {"name": "Base", "firstChannel": 0, "numChannels": 3, "rgbColorSpace": "sRGB"},
        {"name": "Rough\x1bness", "firstChannel": 3, "numChannels": 2},
    ],
    "latents": [{"highResWidth": 128, "highResHeight": 64, "lowResWidth": 64, "lowResHeight": 32}],
    "mlpVersions": [
        {
            "layers": [{"inputChannels": 48, "outputChannels": 32}, {"inputChannels": 32, "outputChannels": 16}],
            "weightType": "Int8",
        }
    ],
    "views": [{"offset": 0, "storedSize": 4096}],
    "colorMips": [{"latentMip": 0}],
}


def ntex(
    description: object = DESCRIPTION, *, version: int = 0x100, data: int = 4096, json_bytes: int | None = None
) -> bytes:
    text = json.dumps(description).encode()
    text += b"\0" * (-len(text) % 4)
    size = len(text) if json_bytes is None else json_bytes
    return struct.pack("<4sIQQQQ", b"NTEX", version, 40, size, 40 + len(text), data) + text + b"\1" * 4096


def test_what_a_texture_set_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "material.ntc"
    path.write_bytes(ntex())
    found = read_ntex(path)
    assert (found.width, found.height, found.mips, found.channels) == (512, 256, 10, 5)
    assert found.networks == ("Int8: 48-32-16",)
    assert found.latent_sizes == ((128, 64),)
    assert found.bits_per_texel == 4096 * 8 / (512 * 256)
    assert cli.main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    for part in ("NVIDIA", "512 x 256", "10 mips", "Base: channels 0 to 2", "Roughness", "not decoded: "):
        assert part in shown
    assert "\x1b" not in shown
    assert cli.main(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["format"] == "NTEX"


@pytest.mark.parametrize(
    ("data", "named"), [(ntex(), "NTEX"), (b'{"version": 1}', "three-ntc"), (b"\xef\xbb\xbf {}", "three-ntc")]
)
@pytest.mark.parametrize(
    "command", ["decode {file} --out {out}", "render --out {out} --pack {file}", "export --pack {file} --out {out}.glb"]
)
def test_every_command_says_whose_file_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], data: bytes, named: str, command: str
) -> None:
    path = tmp_path / "material.ntc"
    path.write_bytes(data)
    assert cli.main(command.format(file=path, out=tmp_path / "out").split()) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {path}: is ")
    assert named in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in DESCRIPTION.items() if name != key}


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (b"NTEX", "truncated"),
        (ntex()[:39], "truncated"),
        (ntex(version=19), "0x13"),
        (ntex(json_bytes=1 << 40), "JSON chunk"),
        (ntex(json_bytes=(1 << 64) - 4), "JSON chunk"),
        (ntex(data=1 << 63), "data chunk"),
        (ntex([]), "not that of a texture set"),
        (ntex(without("width")), "width"),
        (ntex({**DESCRIPTION, "width": 0}), "width"),
        (ntex({**DESCRIPTION, "schemaVersion": 2}), "schemaVersion"),
        (ntex({**DESCRIPTION, "views": [{"offset": 4000, "storedSize": 200}]}), "view"),
        (ntex({**DESCRIPTION, "textures": [{"name": "a", "firstChannel": 4, "numChannels": 3}]}), "channels"),
        (ntex({**DESCRIPTION, "textures": [{"name": 3, "firstChannel": 4, "numChannels": 1}]}), "name"),
    ],
)
def test_broken_texture_sets_are_refused_in_a_line(tmp_path: Path, data: bytes, named: str) -> None:
    path = tmp_path / "material.ntc"
    path.write_bytes(data)
    with pytest.raises(InputError, match=named):
        read_ntex(path)


def test_spoilt_texture_sets_never_crash(tmp_path: Path) -> None:
    random, whole = np.random.default_rng(3), np.frombuffer(ntex(), np.uint8)
    path = tmp_path / "material.ntc"
    for _ in range(400):
        spoilt = whole.copy()
        spoilt[random.integers(4, 900, 3)] = random.integers(0, 256, 3)
        path.write_bytes(spoilt[: random.integers(30, len(spoilt) + 1)].tobytes())
        try:
            read_ntex(path)
        except InputError:
            continue


def test_packs_are_packs(tmp_path: Path) -> None:
    assert other_format(b"\x10\x00\x00\x00\x00\x00\x00\x00{") is None
    assert other_format(b"") is None
    path = tmp_path / "a.ntc"
    path.write_bytes(b"\x10\x00\x00\x00")
    with pytest.raises(InputError, match="not a safetensors file"):
        read_pack(path)
