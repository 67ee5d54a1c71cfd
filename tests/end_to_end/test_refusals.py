"""Every command refuses bad input with one line and exit status 2, and leaves no file."""

import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import grid_parts
from ntc.pack.file import write_pack
from tests.drivers.messages import error_line
from tests.end_to_end.conftest import two_squares
from tests.ui.conftest import write_scene
from viewer import cli
from viewer.gl.allocation import LIMIT_VARIABLE
from viewer.gl.context import create_headless_context
from viewer.gl.context_loss import LOSE_VARIABLE
from viewer.scene.images import write_png

BENCH = "bench {scene} --json r.json --repeats 1"
LOST = "the graphics driver was reset"
SMALL = "--size 64x48"

REFUSED: dict[str, list[tuple[str, str]]] = {
    "render {scene} --out o": [
        ("--camera nowhere", "nowhere"),
        ("--grouping baseline", "baseline"),
        ("--eye 0 0 1", "--target"),
        ("--size 0x10", "0x10"),
        ("--fov 400 --eye 0 0 1 --target 0 0 0", "fov"),
        ("--require-gpu", "llvmpipe"),
        ("--out {file}", "is here"),
        ("--view lit --environment nowhere.hdr", "nowhere.hdr"),
        ("--view lit --sun nan 0", "sun azimuth"),
        ("--view lit --sun 10 95", "sun elevation"),
        ("--view lit --exposure 99", "exposure"),
        ("--error-by-map", "--error-by-map"),
        ("--pack {other_pack}", "0 of 2 textures match"),
    ],
    "render --out o": [("--grouping nonsense", "--grouping nonsense: no such pack")],
    "encode {scene} --out o.ntc": [
        ("--grouping covisible --sampled-views -1", "--sampled-views -1: must be 0 to 1000"),
        ("--grouping covisible --sampled-views 0", "the scene has no cameras"),
        ("--grouping clustered --sampled-views 5", "only --grouping covisible"),
        ("--grouping clustered --labels l.csv", "only --grouping category"),
        ("--grouping category --labels nowhere.csv", "nowhere.csv: cannot be read"),
        ("--grouping clustered --features shape", "shape"),
        ("--grouping clustered --features clip", "--clip-weights"),
        ("--grouping clustered --clusters 1000", "there are only 2 textures"),
        ("--grouping single --views v.json", "only --grouping covisible"),
        ("--grouping covisible --views nowhere.json", "nowhere.json"),
        ("--grouping clustered --clusters 0", "at least 1"),
    ],
    "encode {images} --grouping single --out o.ntc": [
        ("--quality 0", "--quality 0: set it above 0 and up to 58.9 dB"),
        ("--quality 100", "--quality 100: set it above 0 and up to 58.9 dB"),
        ("--quality nan", "--quality nan: set it above 0"),
        ("--size 0", "--size 0: must be a number of megabytes above 0"),
        ("--size 0.001", "--size 0.001: at least 0.0"),
        ("--bits 0", "--bits 0: must be above 0"),
        ("--bits -1", "must be above 0"),
        ("--bits nan", "must be above 0"),
        ("--bits 1000", "--bits 1000: set it above 0 and up to"),
        ("--preset huge", "huge"),
        ("--bits 2 --quality 30", "--bits and --quality exclude each other: give one of them"),
        ("--size 1 --preset fast", "--size and --preset exclude each other: give one of them"),
        ("--quality 30 --steps 5", "--quality 30: only --codec block takes it"),
        ("--codec grid --preset 2bit", "--preset 2bit: only --codec block takes it"),
        ("--size 1 --views v.json", "--views v.json: a folder of images has no viewpoints"),
        ("--quality 30 --views v.json", "--views v.json: only --grouping covisible and --size take it"),
        ("--codec block --steps 5", "--steps 5: codec block is not trained"),
        ("--codec block --epochs 5", "codec block is not trained"),
        ("--codec block --state a.state", "--state a.state: codec block is not trained"),
        ("--codec block --recipe paper", "--recipe paper: codec block is not trained"),
        ("--codec block --device cuda", "--device cuda: codec block is not trained"),
        ("--codec grid --bits 2", "--bits 2: only --codec block"),
        ("--codec grid --recipe paper --bits 2", "--bits 2: only --codec block"),
        ("--codec wavelet", "wavelet"),
        ("--workers 0", "--workers 0: must be at least 1"),
        ("--workers 2 --ray auto", "--workers and --ray exclude each other"),
        ("--workers 2 --quality 30", "--quality: needs all textures at once"),
        ("--ray auto", "--ray: needs the extra `ray`: pip install 'ntc-viewer[ray]'"),
        ("--ray auto --gpus-per-job -1", "--gpus-per-job -1: must be 0 or more"),
        ("--decoders none.ntc", "none.ntc: no such file"),
        ("--decoders none.ntc --maps base --bits 2", "--bits: is set by the pack of --decoders none.ntc"),
        ("--report report", "encode --report: the option was removed; write a report with: ntc-viewer check"),
    ],
    "encode {images}": [("--out {images}", "holds other files and no library")],
    BENCH: [
        ("--what nothing", "nothing"),
        ("--size 0x10", "0x10"),
        ("--worst-sizes 64x64 0x64", "0x64"),
        ("--worst-sizes 99999x99999", "99999x99999"),
        ("--worst-sizes", "worst-sizes"),
        ("--scaling-sizes 8", "8"),
        ("--size 16384x16384 --what scene", "more than --memory-mb 4096"),
        ("--size 2048x2048 --memory-mb 16", "more than --memory-mb 16"),
        ("--memory-mb 0", "--memory-mb 0: must be at least"),
        ("--repeats 0", "--repeats 0: must be at least 1"),
        ("--decoders 0", "--decoders 0: must be 1 to 64"),
        ("--decoders 65", "--decoders 65: must be 1 to 64"),
        ("--hidden-width 260", "--hidden-width 260: must be a multiple of 4"),
        ("--pack nowhere.ntc", "nowhere.ntc"),
        ("--decoder-variant gpu --what worst-case", "--decoder-variant gpu: only --what scene and all"),
        ("--views nowhere.json", "nowhere.json"),
        ("--paths sideways", "sideways"),
        ("--json record.txt", "record.txt: the name of a record must end in .json"),
    ],
    "bench --json r.json": [
        ("nowhere.glb", "nowhere.glb"),
        ("{bare}", "has no packs beside it; name some with --pack"),
    ],
    "study": [
        ("", "no such study"),
        ("nothing", "study nothing: no such study (there are: paper-textures, paper-scenes, rate, stability)"),
        ("clusters --out o", "study clusters: no such study (there are: paper-textures, "),
        ("paper-scenes nowhere.glb --out o", "nowhere.glb"),
        ("paper-scenes {images} --out o", "is not a scene; use study paper-textures"),
        ("paper-textures {images} --out o --steps 0", "--steps 0: must be at least 1"),
        ("rate nowhere.glb --out o --clusters 0", "--clusters 0: must be at least 1"),
        ("rate {images} --out o --bits 0", "--bits 0: must be above 0"),
        ("rate {images} --out o --most 0", "--most 0: must be at least 1"),
        ("rate in --out o --workers 2", "study rate --workers: the option was removed"),
        ("rate in --out o --ray=auto", "leave it out, points are measured one after the other"),
        ("stability --out o --texels 0", "--texels 0: must be at least 1"),
        ("stability nowhere.glb --out o", "nowhere.glb"),
    ],
    "library": [
        ("add new", "name the packs"),
        ("add new none.ntc", "none.ntc"),
        ("list none", "holds no library"),
        ("assign {library} {images}", "ntc-viewer encode SCENE --decoders F.ntc"),
        ("compact {library}", "the index renews itself"),
        ("verify {library} more", "the library alone"),
        ("extract {library}", "--out"),
        ("extract {library} --out x.png", "--out"),
        ("list {library} --out x.ntc", "only extract"),
        ("verify {library} --json", "only list"),
    ],
    "check {scene} --pack {pack}": [
        ("--budget absent.toml", "absent.toml: cannot be read"),
        ("--against absent.json", "absent.json: cannot be read"),
        ("--grouping reference", "has no pack to check"),
        ("--out {file}", "is a file; name a folder"),
    ],
    "export": [
        ("{scene} --pack {pack} --out scene.txt", ".gltf or .glb"),
        ("{scene} --pack {pack} --out {scene}", "the scene itself"),
        ("{scene}", "--out"),
        ("{bare} --out o.gltf", "no pack lies beside it"),
        ("{scene} --pack {pack} --as png --out {images}/o.gltf", "o.losses.csv"),
        ("{scene} --pack none.ntc --out o.glb", "none.ntc"),
        ("none.glb --pack {pack} --out o.glb", "none.glb"),
        ("--pack {pack} --out o.glb", "another scene"),
        ("{scene} --pack {pack} {pack} --out o.glb", "one pack"),
        ("{scene} --pack {pack}", "--web"),
        ("{scene} --pack {pack} --web new --out new.glb", "--web"),
        ("{scene} --pack {pack} --web new --as png", "--as"),
        ("{scene} --pack {pack} --web {scene}", "is a file"),
        ("{scene} --pack {pack} --web {images}", "other files"),
        ("--pack {pack} --web new", "another scene"),
        ("{scene} --pack none.ntc --web new", "none.ntc"),
        ("--shader glsl --pack {pack} --out {images}", "other files"),
        ("--shader glsl --pack {pack}", "--out"),
        ("--shader glsl --pack {pack} --web new", "--shader"),
        ("--shader glsl --pack {pack} --out new --as png", "--shader"),
        ("--shader glsl --pack {short_pack} --out new", "short.ntc"),
    ],
    "view {scene} --headless --out o --size 160x120": [
        ("--exec 'wait frames 1; compare.mod a'", "--exec:2: 'compare.mod': no such command; did you mean"),
        ("--exec 'expect source nothing'", "--exec:1: expected that source is 'nothing'"),
        ("--script missing.script", "missing.script: cannot be read"),
        ("--size 10x10", "--size: each side must be 64 to 8192"),
    ],
}
SIMULATED: list[tuple[str, str, str]] = [
    (f"{LIMIT_VARIABLE}=0", f"render {{scene}} --grouping reference --out o {SMALL}", "vertices of"),
    (f"{LIMIT_VARIABLE}=1", "render {scene} --grouping reference --out o --size 2000x1000", "no memory for 32 MB"),
    (f"{LIMIT_VARIABLE}=much", f"render {{scene}} --out o {SMALL}", "must be a whole number of MB"),
    (f"{LOSE_VARIABLE}=1", f"render {{scene}} --out o {SMALL}", LOST),
    # The last check of `render` comes after all that is read back: everything that is drawn is checked.
    (f"{LOSE_VARIABLE}=7", f"render {{scene}} --out o {SMALL}", LOST),
    (f"{LOSE_VARIABLE}=2", f"{BENCH} --what worst-case --worst-sizes 64x64 --decoders 1", LOST),
    (f"{LOSE_VARIABLE}=5", f"study stability {{scene}} --texels 20 --out o {SMALL}", LOST),
    (f"{LOSE_VARIABLE}=1", "decode {pack} --out o --backend gl", LOST),
    (f"{LOSE_VARIABLE}=soon", "render {scene} --out o", LOSE_VARIABLE),
]
"""(variable of the environment, command, words) of a GPU without memory, and of one that is reset."""
BAD_FILES = ("missing.glb", "not_json.gltf", "truncated.glb", "accessor.glb", "extension.glb", "empty.glb")
BAD_PACKS = ("empty.ntc", "truncated.ntc", "header.ntc", "text.ntc", "nan.ntc")
Places = dict[str, Path]


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Places:
    """What commands name: good files, and all of BAD_FILES and BAD_PACKS."""
    folder = tmp_path_factory.mktemp("given")
    found = {name: folder / name for name in ("images", "library", "bad", "other")}
    for place in found.values():
        place.mkdir()
    (found["images"] / "o.losses.csv").mkdir()
    scene, other = write_scene(folder), write_scene(found["other"], seed=99)
    for number in range(2):
        noise = np.random.default_rng(number).integers(0, 256, (16, 16, 3), np.uint8)
        write_png(found["images"] / f"{number}.png", noise)
    (folder / "is here").write_text("mine")
    pack = scene.with_name("scene.single.ntc")
    content, bad = pack.read_bytes(), found["bad"]
    (bad / "short.ntc").write_bytes(content[:-3])
    assert cli.main(["library", "add", str(found["library"]), str(pack)]) == 0
    claims = two_squares()
    claims.json["accessors"][0]["count"] = 10**9
    unknown = two_squares()
    unknown.json["extensionsRequired"] = unknown.json["extensionsUsed"] = ["VENDOR_unheard_of"]
    broken = random_pack(((32, 32),), (0,))
    grid_parts(broken).decoders[0].weights[1][3, 3] = np.nan
    write_pack(bad / "nan.ntc", broken)
    texts = {
        "not_json.gltf": b'{"asset": {"version": "2.0"}, "nodes": [',
        "truncated.glb": two_squares().glb()[:-700],
        "accessor.glb": claims.glb(),
        "extension.glb": unknown.glb(),
        "empty.glb": b"",
        "empty.ntc": b"",
        "truncated.ntc": content[:-100],
        "header.ntc": content[:20],
        "text.ntc": b"not a pack at all, only words" * 3,
    }
    for name, text in texts.items():
        (bad / name).write_bytes(text)
    return {
        **found,
        "scene": scene,
        "pack": pack,
        "file": folder / "is here",
        "other_pack": other.with_name("scene.single.ntc"),
        "short_pack": bad / "short.ntc",
        "bare": two_squares().write(folder / "bare.glb"),
    }


class Refusals:
    """Runs commands in an empty folder."""

    def __init__(self, places: Places, capsys: pytest.CaptureFixture[str]) -> None:
        self.places, self._capsys = places, capsys

    def check(self, command: str, *words: str) -> None:
        """The command is refused with one line that has `words`, and writes nothing, here and where it reads."""
        names = {name: str(place) for name, place in self.places.items()}
        given = {path: path.stat().st_mtime_ns for path in self.places["scene"].parent.rglob("*")}
        self._capsys.readouterr()
        assert cli.main([word.format(**names) for word in shlex.split(command)]) == 2
        line = error_line(self._capsys.readouterr().err)
        assert all(word in line for word in words), line
        assert not [path for path in Path().rglob("*") if path.is_file()]
        assert given == {path: path.stat().st_mtime_ns for path in self.places["scene"].parent.rglob("*")}


@pytest.fixture
def refusals(
    places: Places, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Refusals:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    return Refusals(places, capsys)


@pytest.mark.parametrize(("command", "more", "words"), [(base, *case) for base in REFUSED for case in REFUSED[base]])
def test_bad_options_are_refused(refusals: Refusals, command: str, more: str, words: str) -> None:
    if more == "--require-gpu" and not create_headless_context().info.is_software:
        pytest.skip("this renderer is a GPU")
    refusals.check(f"{command} {more}", words)


@pytest.mark.parametrize(("variable", "command", "words"), SIMULATED)
def test_a_gpu_that_fails_is_one_line(
    refusals: Refusals, monkeypatch: pytest.MonkeyPatch, variable: str, command: str, words: str
) -> None:
    monkeypatch.setenv(*variable.split("="))
    refusals.check(command, words)


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_scenes_are_refused(refusals: Refusals, name: str) -> None:
    for command in ("render {bad}/%s --out o", "info {bad}/%s", "encode {bad}/%s --out o.ntc"):
        refusals.check(command % name, "VENDOR_unheard_of" if name == "extension.glb" else name)


@pytest.mark.parametrize("name", BAD_PACKS)
def test_bad_packs_are_refused(refusals: Refusals, name: str) -> None:
    for command in ("render {scene} --pack {bad}/%s --out o", "decode {bad}/%s --out o", "info {bad}/%s"):
        refusals.check(command % name, name)
