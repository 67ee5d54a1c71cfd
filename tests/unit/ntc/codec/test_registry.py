"""Every codec keeps to the interface, and what is not of one codec asks the registry for it."""

import ast
import json
import tomllib
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, cast, get_args

import pytest

from ntc.codec.codec import Codec
from ntc.codec.maps import MAP_CHANNELS, MAPS
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.codec.registry import FIRST_NAME, MODULES, SUMMARIES, CodecName, codec_named, codec_of
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from ntc.pack.schema import KIND
from tests.support.pack_bytes import PackBytes

ROOT = Path(__file__).resolve().parents[4]
FOLDERS = tuple(f"ntc.codec.{name}" for name in MODULES)
CHOICES_OF_THE_USER = ("ntc.__init__", "ntc.api")
"""They name `TrainingConfig`, which callers of the library fill in."""


def settings_of(name: str) -> list[CodecSettings]:
    """Settings with defaults, and with other values of what every codec has."""
    plain = codec_named(name).settings_type()
    channels = sum(MAP_CHANNELS[each] for each in MAPS)
    changes: list[dict[str, Any]] = [
        {},
        {"levels": 1, "output_channels": 4},
        {"output_channels": channels, "maps": MAPS},
    ]
    return [replace(cast(Any, plain), **change) for change in changes]


def empty_file(folder: Path, settings: CodecSettings) -> Path:
    """A pack file without textures."""
    path = folder / "empty.ntc"
    write_pack(path, Pack(settings, Grouping("baseline", ()), (), ()))
    return path


def test_there_is_a_codec_in_every_folder_and_no_other() -> None:
    found = {path.parent.name for path in (ROOT / "ntc" / "codec").glob("*/codec.py")}
    assert found == set(MODULES)
    assert FIRST_NAME in MODULES
    assert set(SUMMARIES) == set(get_args(CodecName)) == found
    with pytest.raises(KeyError):
        codec_named("wavelet")


@pytest.mark.parametrize("name", MODULES)
def test_a_codec_has_every_method_and_no_state(name: str) -> None:
    codec = codec_named(name)
    assert isinstance(codec, Codec)
    assert type(codec).__abstractmethods__ == frozenset()
    assert vars(codec) == {}
    settings = codec.settings_type()
    assert is_dataclass(settings)
    assert settings.kind == name
    assert codec_of(settings) is codec
    with pytest.raises(AttributeError):
        cast(Any, settings).levels = 2


@pytest.mark.parametrize("name", MODULES)
def test_settings_come_back_from_a_file(tmp_path: Path, name: str) -> None:
    for settings in settings_of(name):
        path = empty_file(tmp_path, settings)
        assert read_pack(path).config == settings
        metadata = PackBytes.of(path.read_bytes()).metadata["codec"]
        assert metadata.get(KIND, FIRST_NAME) == name
        assert json.loads(json.dumps(metadata)) == metadata


@pytest.mark.parametrize("name", MODULES)
def test_files_may_lack_the_fields_that_were_added_and_no_others(tmp_path: Path, name: str) -> None:
    codec = codec_named(name)
    settings = codec.settings_type()
    known = {field.name: field.default for field in fields(cast(Any, settings))}
    assert codec.added_fields <= set(known)
    path = empty_file(tmp_path, settings)
    pieces = PackBytes.of(path.read_bytes())
    for field, default in known.items():
        path.write_bytes(pieces.changed(lambda parts, field=field: parts.metadata["codec"].pop(field, None)))  # type: ignore[misc]
        if field in codec.added_fields:
            assert default is not MISSING
            assert read_pack(path).config == settings
        else:
            with pytest.raises(InputError, match=r"metadata\.codec has fields"):
                read_pack(path)


def test_every_module_that_codecs_share_has_a_layer() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (each["layers"] for each in contracts if each.get("containers") == ["ntc.codec"])
    named = {module.strip() for layer in layers for module in layer.split("|")}
    assert named == {path.stem for path in (ROOT / "ntc" / "codec").glob("*.py")} - {"__init__"}


def imported(path: Path) -> Iterator[str]:
    """Modules that a file names in its imports, at its top or within, for types alone too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def is_below(module: str, packages: tuple[str, ...]) -> bool:
    return any(module == package or module.startswith(f"{package}.") for package in packages)


def test_nothing_outside_of_a_codec_imports_it() -> None:
    found = {}
    for path in sorted((ROOT / "ntc").rglob("*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        own = tuple(folder for folder in FOLDERS if is_below(module, (folder,)))
        others = tuple(folder for folder in FOLDERS if folder not in own)
        names = sorted(name for name in imported(path) if is_below(name, others))
        if names and not is_below(module, CHOICES_OF_THE_USER):
            found[module] = names
    assert found == {}
