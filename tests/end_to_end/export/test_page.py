"""`ntc-viewer export --web`: the page shows the texels of packs, asks for nothing outside its folder, and tells faults."""

import base64
import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.reference import decode_image
from ntc.pack.file import read_pack
from tests.end_to_end.export.browser import Browser, served
from tests.end_to_end.export.material_scene import materials_scene
from viewer import cli
from viewer.export.web.export import HERE
from viewer.scene.images import decode_image as decode_picture

ENCODINGS = {
    "grid": ["--codec", "grid", "--steps", "30", "--device", "cpu", "--maps", "base"],
    "block": ["--codec", "block", "--bits", "4", "--maps", "base"],
    "materials": ["--codec", "block", "--bits", "8", "--maps", "all"],
}
TEXELS = 100_000
SIDE = 192
"""Of the three textures whose texels are compared."""
COMPLETE = "['complete', 'failed'].includes(document.documentElement.dataset.state)"
ERROR = "document.getElementById('error').hidden ? '' : document.getElementById('error').textContent"
# Base64 of all texels of the finest mip of a texture entry, as the GPU has them.
READ = """
(async () => {
    const { stage, renderer } = window.ntcPage;
    const { parser } = await stage.reading;
    const texture = await parser.getDependency("texture", %d);
    const { plugin } = stage.sources[0];
    plugin.want(new Map([[texture, 0]]));
    await plugin.complete();
    renderer.initTexture(texture);
    const { width, height } = texture.image;
    const gl = renderer.getContext();
    const buffer = gl.createFramebuffer();
    renderer.state.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, renderer.properties.get(texture).__webglTexture, 0);
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    renderer.setRenderTarget(null);
    let letters = "";
    for (let at = 0; at < bytes.length; at += 8192) letters += String.fromCharCode(...bytes.subarray(at, at + 8192));
    return [width, height, btoa(letters)];
})()"""

pytestmark = [pytest.mark.process, pytest.mark.guards("exports")]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return materials_scene().write(tmp_path_factory.mktemp("scene") / "scene.glb")


def page_of(scene: Path, folder: Path, *kinds: str) -> tuple[Path, Pack]:
    """The page of `scene` in encodings of ENCODINGS, and the first pack."""
    packs = []
    for kind in kinds:
        packs.append(folder / f"{kind}.ntc")
        command = ["encode", str(scene), "--out", str(packs[-1]), "--grouping", "baseline", *ENCODINGS[kind]]
        assert cli.main(command) == 0
    page = folder / f"page of {kinds[0]}"
    assert cli.main(["export", str(scene), "--pack", *map(str, packs), "--web", str(page)]) == 0
    return page, read_pack(packs[0])


def faults(browser: Browser) -> list[str]:
    """What the page wrote to the console, but for what the driver says of the test's reading, and three.js of its scene."""
    return [line for line in browser.messages if "GPU stall" not in line and "Missing min/max" not in line]


def shown(browser: Browser, texture: int) -> NDArray[np.uint8]:
    """[H, W, 4]: the finest mip of a texture entry, as the GPU has it."""
    width, height, data = browser.ask(READ % texture)
    return np.frombuffer(base64.b64decode(data), np.uint8).reshape(height, width, 4)


def compare(browser: Browser, page: Path, pack: Pack, places: tuple[str, ...] = ("baseColorTexture",)) -> int:
    """Compare textures that materials read at `places` with the float64 reference; returns the number of texels."""
    document = json.loads((page / "scene.gltf").read_text())
    owners = [own for material in document["materials"] for own in (material, material.get("pbrMetallicRoughness", {}))]
    numbers = {owner[place]["index"] for owner in owners for place in places if place in owner}
    texels = 0
    for number in sorted(numbers):
        texture = document["textures"][number]
        for option in texture.get("extensions", {}).get("NV_texture_swizzle", {}).get("options", [])[:1]:
            expected = decode_image(pack, option["arrayLayer"], 0)
            pixels = shown(browser, number)
            held = [component for component in range(4) if option["channels"][component] >= 0]
            wanted = expected[..., [option["channels"][component] for component in held]]
            assert np.abs(pixels[..., held].astype(int) - wanted).max() <= 2, number
            texels += pixels.shape[0] * pixels.shape[1]
    return texels


@pytest.mark.parametrize("kind", list(ENCODINGS))
def test_the_browser_shows_what_the_float64_reference_decodes(tmp_path: Path, browser: Browser, kind: str) -> None:
    scene = materials_scene(SIDE).write(tmp_path / "scene.glb")
    page, pack = page_of(scene, tmp_path, kind)
    places = ("baseColorTexture", "normalTexture", "metallicRoughnessTexture", "occlusionTexture")
    with served(page) as address:
        browser.open(address)
        browser.wait(COMPLETE)
        assert browser.ask(ERROR) == ""
        assert faults(browser) == []
        assert compare(browser, page, pack, places) >= TEXELS
        assert all(url.startswith((address, f"blob:{address}")) for url in browser.requests)


@pytest.mark.parametrize("size", [(390, 844)])
def test_the_page_fits_the_window(scene: Path, tmp_path: Path, browser: Browser, size: tuple[int, int]) -> None:
    page, pack = page_of(scene, tmp_path, "materials")
    with served(page) as address:
        browser.resize(*size, mobile=size[0] < 500)
        browser.open(f"{address}#split=0.5&heat=1&view=base")
        browser.wait(COMPLETE)
        assert browser.ask(ERROR) == ""
        picture = decode_picture(browser.picture(), "the page")
        assert picture.shape[:2] == (size[1], size[0])
        assert picture.std() > 10.0
        assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
        boxes = "['panel', 'name', 'divider'].map((id) => document.getElementById(id).getBoundingClientRect())"
        inside = f"{boxes}.every((box) => box.left >= 0 && box.right <= window.innerWidth && box.bottom <= window.innerHeight)"
        assert browser.ask(inside)
        # Three materials side by side, each with a decoder of its own: two of them in blocks on a seam.
        assert len({texture.group for texture in pack.textures}) == 3
        most, across, shown_across = browser.ask(
            "[window.ntcPage.view.map.most, window.ntcPage.view.map.across, document.getElementById('map').clientWidth]"
        )
        assert most == 2
        assert across == -(-size[0] // 8)
        assert shown_across == 8 * across
        limit = 96 if size[0] < 500 else 256
        assert f"of {limit} MB" in browser.ask("document.getElementById('status').textContent")


SIDES = "[...document.getElementById('sides').children].map((own) => own.textContent)"
CENTRES = """(() => {
    const { stage, view, renderer } = window.ntcPage;
    view.draw();
    const gl = renderer.getContext();
    const pixel = new Uint8Array(4);
    return [0.3, 0.7].map((place) => {
        gl.readPixels(Math.floor(place * gl.drawingBufferWidth), gl.drawingBufferHeight >> 1, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return [...pixel];
    });
})()"""
"""Colours of the picture left and right of its middle."""


def test_two_packs_and_the_reference_are_compared(tmp_path: Path, browser: Browser) -> None:
    scene = materials_scene(SIDE).write(tmp_path / "scene.glb")
    page, _ = page_of(scene, tmp_path, "materials", "block")
    with served(page) as address:
        browser.resize(1280, 720)
        browser.open(f"{address}#view=base")
        browser.wait(COMPLETE)
        assert browser.ask(SIDES) == ["materials", "Reference"]
        browser.ask("window.ntcPage.panel.set({ b: 1 })")
        browser.wait("window.ntcPage.view.isComplete")
        assert browser.ask(SIDES) == ["materials", "block"]
        left, right = browser.ask(CENTRES)
        space = {"key": " ", "code": "Space", "windowsVirtualKeyCode": 32}
        browser.call("Input.dispatchKeyEvent", type="keyDown", **space)
        assert browser.ask(SIDES) == ["block", "materials"]
        browser.wait("window.ntcPage.view.isComplete")
        held = browser.ask(CENTRES)
        browser.call("Input.dispatchKeyEvent", type="keyUp", **space)
        assert browser.ask(SIDES) == ["materials", "block"]
        browser.wait("window.ntcPage.view.isComplete")
        assert browser.ask(CENTRES) == [left, right]
        assert held != [left, right]
        assert np.abs(np.array(held) - [left, right]).max() < 40
        assert faults(browser) == []


def test_damaged_files_are_told_in_a_line(scene: Path, tmp_path: Path, browser: Browser) -> None:
    page, _ = page_of(scene, tmp_path, "block")
    for name in ("scene.baseline.ntc", "scene.files/buffer0.bin", "scene.gltf", "page.json"):
        spoilt = tmp_path / name.replace("/", "_")
        shutil.copytree(page, spoilt)
        (spoilt / name).write_bytes((spoilt / name).read_bytes()[: -100 if name.endswith(".bin") else -5])
        with served(spoilt) as address:
            browser.open(address)
            browser.wait("!document.getElementById('error').hidden")
            line = browser.ask(ERROR)
        assert ("scene.gltf" if name.endswith(".bin") else name) in line
        assert "\n" not in line


def test_three_js_in_the_page_is_current() -> None:
    vendor = HERE / "vendor"
    inputs = ("build.sh", "names.js", "package.json", "package-lock.json")
    digest = hashlib.sha256(b"".join((vendor / name).read_bytes() for name in inputs)).hexdigest()[:16]
    version = json.loads((vendor / "package.json").read_text())["dependencies"]["three"]
    banner = (vendor / "three.js").read_text()[:200]
    assert f"three.js {version}," in banner
    assert f"from {digest} " in banner, "run bash viewer/export/web/vendor/build.sh"


def test_the_page_allows_its_import_map() -> None:
    text = (HERE / "page" / "index.html").read_text()
    content = re.search('<script type="importmap">(.*?)</script>', text)
    assert content is not None
    digest = base64.b64encode(hashlib.sha256(content[1].encode()).digest()).decode()
    assert f"'sha256-{digest}'" in text
