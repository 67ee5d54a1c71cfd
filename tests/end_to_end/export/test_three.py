"""integrations/three: three.js shows the texels of packs, coarse mips first, and the other images where a pack cannot be read."""

import base64
import importlib.util
import json
import shutil
import struct
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.mips import coded_z, mip_chain
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.pack.file import read_pack
from tests.end_to_end.export.browser import Browser, Ranges, served
from tests.end_to_end.export.material_scene import materials_scene, waves
from viewer import cli
from viewer.export.web.export import HERE, PLUGIN_FILES
from viewer.locations import builtin_scene_path

ROOT = Path(__file__).resolve().parents[3]
PLUGIN = ROOT / "integrations" / "three"
PACKS = ROOT / "tests" / "conformance" / "packs"
SIDE = 136
SWIZZLE = "NV_texture_swizzle"
READY = "window.own !== undefined"

pytestmark = [pytest.mark.process, pytest.mark.guards("exports")]


def build_script() -> ModuleType:
    """The module integrations/three/build.py."""
    spec = importlib.util.spec_from_file_location("build_three", PLUGIN / "build.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder to serve, with the page, three.js and the plug-in."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(HERE / "vendor" / "three.js", folder)
    plugin = folder / "ntc-three"
    for name in PLUGIN_FILES:
        (plugin / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PLUGIN / name, plugin / name)
    build_script().copy_tables(plugin)
    shutil.copy(Path(__file__).with_name("three.html"), folder / "index.html")
    return folder


@pytest.fixture(scope="module")
def page(site: Path, browser: Browser) -> Iterator[Browser]:
    with served(site) as address:
        browser.open(address)
        browser.wait(READY)
        yield browser


@pytest.fixture
def ranges(site: Path, page: Browser) -> Iterator[Browser]:
    """The page, from a server that answers ranges of bytes."""
    before = page.ask("location.href")
    with served(site, Ranges) as address:
        page.open(address)
        page.wait(READY)
        yield page
    page.open(before)
    page.wait(READY)


@pytest.fixture(scope="module")
def materials(site: Path) -> Path:
    """materials.glb with all kinds of maps, its pack beside it."""
    scene = materials_scene(SIDE).write(site / "scene.glb")
    pack = site / "scene.universal.ntc"
    command = ["encode", str(scene), "--out", str(pack), "--grouping", "universal", "--maps", "all", "--bits", "8"]
    assert cli.main(command) == 0
    out = site / "materials.glb"
    assert cli.main(["export", str(scene), "--pack", str(pack), "--out", str(out)]) == 0
    return out


def load(page: Browser, name: str, texture_format: str, workers: int = 1, report: bool = True) -> list[int]:
    """Widths of the textures of a scene when three.js has it."""
    page.messages.clear()
    found: list[int] = page.ask(f"own.load({name!r}, {texture_format!r}, {workers}, {json.dumps(report)})")
    return found


def faults(page: Browser) -> list[str]:
    """What the page wrote to the console, but for what the driver says of reading pixels, and three.js of the test's scene."""
    return [line for line in page.messages if "GPU stall" not in line and "Missing min/max" not in line]


def glb_json(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    found: dict[str, Any] = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    return found


def glb_binary(path: Path) -> bytes:
    data = path.read_bytes()
    return data[28 + struct.unpack_from("<I", data, 12)[0] :]


def write_glb(path: Path, document: dict[str, Any], binary: bytes) -> None:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def shown(page: Browser, index: int, width: int, height: int, level: int = 0) -> NDArray[np.uint8]:
    """[height, width, 4]: a mip of a texture entry, as the GPU reads it."""
    data = base64.b64decode(page.ask(f"own.texels({index}, {level})"))
    return np.frombuffer(data, np.uint8).reshape(height, width, 4)


def compare(page: Browser, scene: Path, level: int = 0, compressed: bool = False, step: int = 1) -> int:
    """Compare every `step`th texture entry with the float64 reference; returns how many were compared."""
    document = glb_json(scene)
    pack = read_pack(scene.with_name(next(i["uri"] for i in document["images"] if i.get("uri", "").endswith(".ntc"))))
    decoded = {}
    entries = 0
    for index, texture in list(enumerate(document["textures"]))[::step]:
        if SWIZZLE not in texture.get("extensions", {}):
            continue
        option = texture["extensions"][SWIZZLE]["options"][0]
        layer, channels = option["arrayLayer"], option["channels"]
        if layer not in decoded:
            decoded[layer] = decode_image(pack, layer, level)
        expected = decoded[layer]
        height, width = expected.shape[:2]
        pixels = shown(page, index, width, height, level)
        held = [component for component in range(4) if channels[component] >= 0]
        assert held
        wanted = expected[..., [channels[component] for component in held]]
        if compressed:
            assert psnr_db(np.ascontiguousarray(pixels[..., held]), np.ascontiguousarray(wanted)) > 33.0
        else:
            assert np.abs(pixels[..., held].astype(int) - wanted).max() <= 2
        entries += 1
    return entries


def test_texels_are_those_of_the_reference(page: Browser, materials: Path) -> None:
    assert set(load(page, "materials.glb", "rgba8")) == {SIDE // 2}, "the first picture has coarse mips"
    page.ask("own.complete()")
    assert page.ask("own.updates") == 5
    assert compare(page, materials) == 5
    assert compare(page, materials, level=3) == 5
    # z of normals is in no channel of the pack.
    number = next(n for n, own in enumerate(glb_json(materials)["images"]) if own.get("name") == "bumps")
    normals = shown(page, number, SIDE, SIDE)
    assert np.abs(normals[..., 2:3].astype(int) - coded_z(normals[..., :2])).max() <= 2
    assert page.ask("own.errors") == []
    assert faults(page) == []


def test_blocks_for_the_gpu_are_near_the_reference(page: Browser, materials: Path) -> None:
    if not page.ask("own.has('EXT_texture_compression_bptc') && own.has('EXT_texture_compression_rgtc')"):
        pytest.skip("this browser has no BC7 and BC5")
    load(page, "materials.glb", "auto", workers=2)
    page.ask("own.complete()")
    formats = page.ask("own.textures.map((texture) => texture.format)")
    assert sorted(set(formats)) == [36285, 36492], "BC5 for normals, else BC7"
    assert compare(page, materials, compressed=True) == 5
    assert faults(page) == []


def test_the_module_is_built_from_libntc_as_it_is() -> None:
    built = (PLUGIN / "generated" / "ntc.wasm").read_bytes()
    assert built.endswith(build_script().source_section()), "run python integrations/three/build.py"
    assert len(built) < 100_000


def test_a_pack_inside_the_file_with_coverage_in_the_other_image(page: Browser, materials: Path, site: Path) -> None:
    document = glb_json(materials)
    covered = next(number for number, own in enumerate(document["textures"]) if own["source"] == 4)
    document["textures"][covered]["extensions"][SWIZZLE]["options"][0]["channels"][3] = -1
    binary = glb_binary(materials)
    image = next(own for own in document["images"] if own.get("uri", "").endswith(".ntc"))
    pack = (site / image.pop("uri")).read_bytes()
    image["bufferView"] = len(document["bufferViews"])
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(pack)})
    binary += pack + bytes(-len(pack) % 4)
    document["buffers"][0]["byteLength"] = len(binary)
    write_glb(site / "inside.glb", document, binary)
    load(page, "inside.glb", "rgba8")
    page.ask("own.complete()")
    coverage = shown(page, covered, SIDE, SIDE)[..., 3]
    assert np.abs(coverage.astype(int) - waves(2, SIDE)[..., 1]).max() <= 1
    normals = shown(page, 0, SIDE, SIDE)
    page.ask("own.load('materials.glb', 'rgba8', 1).then(own.complete)")
    np.testing.assert_array_equal(normals, shown(page, 0, SIDE, SIDE))
    assert faults(page) == []


def test_a_pack_that_cannot_be_read_leaves_the_other_images(page: Browser, materials: Path, site: Path) -> None:
    text = materials.read_bytes()
    pack = next(own["uri"] for own in glb_json(materials)["images"] if own.get("uri", "").endswith(".ntc"))
    whole = (site / pack).read_bytes()
    contents = {"tensor": whole[: len(whole) // 2], "safetensors": whole[:50], "not there": None}
    for number, (reason, content) in enumerate(contents.items()):
        # A browser keeps files by their names.
        name = f"spoilt{number}".ljust(len(pack), "_")
        (site / f"spoilt{number}.glb").write_bytes(text.replace(pack.encode(), name.encode()))
        if content is not None:
            (site / name).write_bytes(content)
        load(page, f"spoilt{number}.glb", "rgba8", report=False)
        own = [line for line in faults(page) if "404" not in line]
        assert len(own) == 1, own
        assert reason in own[0], own
        pixels = shown(page, 0, SIDE, SIDE)[..., :3]
        assert np.abs(pixels.astype(int) - waves(0, SIDE)).max() <= 1


def test_the_first_picture_needs_few_bytes_of_a_pack(ranges: Browser, materials: Path, site: Path) -> None:
    """Of a server that answers ranges. The pack has 55 material sets of 512 x 512 texels, the scene shows two of them."""
    document = glb_json(materials)
    courtyard = Path(builtin_scene_path().parent / "courtyard.clustered.ntc")
    shutil.copy(courtyard, site)
    next(own for own in document["images"] if own.get("uri", "").endswith(".ntc"))["uri"] = courtyard.name
    for texture in document["textures"]:
        option = texture["extensions"][SWIZZLE]["options"][0]
        option.update(arrayLayer=min(option["arrayLayer"], 1), channels=[0, 1, 2, 5], extras={})
    write_glb(site / "few.glb", document, glb_binary(materials))
    assert set(load(ranges, "few.glb", "rgba8", workers=2)) == {128}
    assert ranges.ask("own.packBytes") < 0.2 * courtyard.stat().st_size
    ranges.ask("own.complete()")
    assert compare(ranges, site / "few.glb", level=2) == 5
    assert compare(ranges, site / "few.glb", step=4) == 2
    # Damaged files are read whole, so that libntc says what is wrong.
    (site / courtyard.name.replace("courtyard", "shortened")).write_bytes(courtyard.read_bytes()[:1_000_000])
    (site / "short.glb").write_bytes((site / "few.glb").read_bytes().replace(b"courtyard.clus", b"shortened.clus"))
    load(ranges, "short.glb", "rgba8", report=False)
    assert len(faults(ranges)) == 1
    assert "tensor" in faults(ranges)[0]


def test_parts_of_packs_lie_where_they_are_looked_for(ranges: Browser, site: Path) -> None:
    packs = sorted(path for path in PACKS.glob("*.ntc"))
    (site / "packs").symlink_to(PACKS)
    parts = []
    for path in packs:
        count = len(read_pack(path).textures)
        parts.append(ranges.ask(f"own.parts('packs/{path.name}', {count}, {{first: 256, coarse: 8, gap: 0}})"))
    assert None not in parts, "together they are the file"
    assert all(part > 0 for part in parts), "each has mips that come later"


COARSE = SIDE >> 4
"""Side of the finest mip that stays out of sight: the first with codes of its own below 32 texels."""
MIPS = 5
"""Of a texture of SIDE x SIDE texels in the pack."""
BYTES = {SIDE >> first: 4 * sum((SIDE >> mip) ** 2 for mip in range(first, MIPS)) for first in range(MIPS)}
"""Bytes of an RGBA8 texture with mips, by the side of the finest."""


def test_mips_come_on_demand_within_a_limit_of_memory(page: Browser, materials: Path) -> None:
    """Of five textures of three sets: a whole material has three, the others one each."""
    page.messages.clear()
    steps = page.ask("own.onDemand('materials.glb', Infinity, 0)")
    assert {step["side"] for step in steps} == {SIDE}
    assert steps[-1]["sides"] == [SIDE] * 5, "nothing is let go of where there is room"
    assert steps[-1]["used"] == 5 * BYTES[SIDE]
    # Room for the whole material alone: its three textures are there together.
    limit = 3 * BYTES[SIDE] + 2 * BYTES[COARSE]
    steps = page.ask(f"own.onDemand('materials.glb', {limit}, 0)")
    assert {step["side"] for step in steps} == {SIDE}
    assert max(step["used"] for step in steps) <= limit
    assert min(steps[-1]["sides"]) == COARSE
    # Too little for any: as fine as fits.
    steps = page.ask(f"own.onDemand('materials.glb', {5 * BYTES[COARSE] + 3 * BYTES[SIDE // 4]}, 0)")
    assert all(COARSE <= step["side"] < SIDE for step in steps)
    # Neighbouring pixels that are two texels apart need mip 1.
    steps = page.ask(f"own.onDemand('materials.glb', Infinity, {2.0 / SIDE})")
    assert {step["side"] for step in steps} == {SIDE // 2}
    assert page.ask("own.errors") == []
    assert faults(page) == []


def test_images_of_the_file_come_on_demand(page: Browser, materials: Path) -> None:
    page.messages.clear()
    steps = page.ask("own.onDemand('materials.glb', Infinity, 0, null)")
    assert {step["side"] for step in steps} == {SIDE}
    assert steps[0]["sides"].count(1) == 4, "one that nobody wants is not read"
    document = glb_json(materials)
    number = document["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    assert np.array_equal(shown(page, number, SIDE, SIDE)[..., :3], waves(1, SIDE))
    # Mips are means of light.
    expected = mip_chain(waves(1, SIDE), "srgb")[2]
    assert np.abs(shown(page, number, SIDE // 4, SIDE // 4, 2)[..., :3].astype(int) - expected).max() <= 1
    assert page.ask("own.errors") == []
    assert faults(page) == []
