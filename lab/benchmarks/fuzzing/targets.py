"""Fuzz target of one reader under libFuzzer (through atheris): `python -m lab.benchmarks.fuzzing.targets READER ...`.

Whatever is neither read nor refused with InputError ends the process, and libFuzzer writes the input to a file.
"""

import contextlib
import importlib
import random
import sys
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import atheris

from lab.benchmarks.fuzzing.mutators import (
    Mutate,
    mutate_archive,
    mutate_gltf,
    mutate_image,
    mutate_json,
    mutate_ktx2,
    mutate_mesh,
    mutate_pack,
)
from ntc.errors import InputError

WATCHED = [
    "viewer.scene",
    "viewer.state.settings",
    "ntc.pack.file",
    "ntc.pack.schema",
    "ntc.codec.model",
    "ntc.codec.block.storage",
    "ntc.codec.block.tensors",
    "ntc.codec.grid.codec",
    "ntc.codec.grid.tensors",
]
WATCHED_SCRIPTS = [
    "viewer.commands",
    "viewer.script",
    "viewer.state.view_file",
    "viewer.state.session",
]
with atheris.instrument_imports(include=[*WATCHED, *WATCHED_SCRIPTS], enable_loader_override=False):
    from lab.benchmarks.fuzzing.scripts import ScriptReader, mutate_script
    from ntc.pack.file import read_pack
    from viewer.scene.cameras_file import read_cameras
    from viewer.scene.gltf.container import parse_gltf
    from viewer.scene.images import decode_image
    from viewer.scene.load import build_scene, load_scene
    from viewer.scene.model import Pose, Scene
    from viewer.scene.report import report_json, report_lines
    from viewer.scene.scene_files import MESH_SUFFIXES
    from viewer.state.settings import parse_settings

# Readers import it when they first need it, which is no file's fault.
importlib.import_module("trimesh")

Mutator = Callable[[bytes, int, random.Random, Mutate], bytes]
PLAIN_SHARE = 0.3
"""Share of mutations that libFuzzer makes alone."""
LONGEST_MESSAGE = 2000
MOMENTS, MOMENTS_A_SECOND = 64, 16
"""Moments at which animations are looked at."""


class Readers:
    """The readers by name; those that need a path get a file in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.by_name: dict[str, tuple[Callable[[bytes], None], Mutator]] = {
            "scene": (self.scene, mutate_gltf),
            "compressed scene": (self.scene, mutate_gltf),
            "moving scene": (self.moving_scene, mutate_gltf),
            "mesh": (self.mesh, mutate_mesh),
            "archive": (self.archive, mutate_archive),
            "pack": (self.pack, mutate_pack),
            "image": (self.image, mutate_image),
            "ktx2": (self.image, mutate_ktx2),
            "cameras": (self.cameras, mutate_json),
            "settings": (self.settings, mutate_json),
            "script": (self.script, mutate_script),
            "view": (self.view, mutate_json),
        }
        self._scripts: ScriptReader | None = None

    def scene(self, data: bytes) -> None:
        """Read `data` as a scene in an empty folder."""
        scene = build_scene(parse_gltf(data, "fuzz.glb", self._folder), "fuzz", None)
        report_json(scene)
        "\n".join(report_lines(scene)).encode()
        _read_pixels(scene)

    def moving_scene(self, data: bytes) -> None:
        """Read `data` as a scene, in its rest pose and at a time of its first animation."""
        file = parse_gltf(data, "fuzz.glb", self._folder)
        build_scene(file, "fuzz", None)
        build_scene(file, "fuzz", None, pose=Pose("", zlib.crc32(data) % MOMENTS / MOMENTS_A_SECOND))

    def mesh(self, data: bytes) -> None:
        """Read `data` behind its first byte, which says what kind of mesh it is, as a mesh and as the materials beside it."""
        suffix = MESH_SUFFIXES[(data[0] if data else 0) % len(MESH_SUFFIXES)]
        path = self._folder / f"fuzz{suffix}"
        for place in (path, path.with_suffix(".mtl")):
            place.write_bytes(data[1:])
        _read_pixels(load_scene(path))

    def archive(self, data: bytes) -> None:
        """Read `data` as a zip archive with a scene."""
        path = self._folder / "fuzz.zip"
        path.write_bytes(data)
        _read_pixels(load_scene(path))

    def pack(self, data: bytes) -> None:
        """Read `data` as a pack."""
        read_pack(self._file(data))

    def image(self, data: bytes) -> None:
        """Read `data` as an image."""
        decode_image(data, "fuzz")

    def cameras(self, data: bytes) -> None:
        """Read `data` as a camera file."""
        read_cameras(self._file(data))

    def settings(self, data: bytes) -> None:
        """Read `data` as settings, the way a file is turned into text."""
        with contextlib.suppress(UnicodeDecodeError):
            parse_settings(data.decode(), "fuzz")

    def script(self, data: bytes) -> None:
        """Take `data` as a script, and run it."""
        self._script_reader().script(data)

    def view(self, data: bytes) -> None:
        """Take `data` as a saved view."""
        self._script_reader().view(data)

    def _script_reader(self) -> ScriptReader:
        if self._scripts is None:
            self._scripts = ScriptReader()
        return self._scripts

    def _file(self, data: bytes) -> Path:
        path = self._folder / "fuzz.bin"
        path.write_bytes(data)
        return path


def _read_pixels(scene: Scene) -> None:
    """Read the textures of a scene, which are decoded when they are needed."""
    for texture in scene.textures:
        assert texture.pixels.shape[1::-1] == texture.size
        assert (texture.alpha is None) == (not texture.has_alpha)
        assert set(texture.further_maps) == set(texture.maps) - {"base"}


def main() -> None:
    """Fuzz the reader named first; the rest are libFuzzer's arguments."""
    reader = sys.argv.pop(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # decode_image writes its input to a temporary file: keep that off the disk too.
        tempfile.tempdir = name
        read, mutator = Readers(folder).by_name[reader]

        def one_input(data: bytes) -> None:
            try:
                read(data)
            except InputError as error:
                line = str(error)
                if "\n" in line or len(line) > LONGEST_MESSAGE or not line.isprintable():
                    raise AssertionError(f"not one printable line: {line[:200]!r}") from error

        def mutate(data: bytes, limit: int, seed: int) -> bytes:
            source = random.Random(seed)
            if source.random() < PLAIN_SHARE:
                return bytes(atheris.Mutate(data, limit))
            return mutator(data, limit, source, atheris.Mutate)[:limit]

        atheris.Setup(sys.argv, one_input, custom_mutator=mutate)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
