"""Material sets plane by plane: every decode path against the float64 codec, original images, and what a view leaves out."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.filtering import decode_filtered
from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import MAP_CHANNELS, MAPS, PLANES, MapName, Plane, ShownMap, plane_channels
from ntc.codec.mips import srgb_to_linear
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from tests.gl.render.test_frame_parity import CASES, SIZE, SIZES, TOLERANCE
from tests.support.covering import covering
from tests.support.gltf_builder import noise
from tests.support.picture_scenes import WHITE, as_set, scene_of, straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, PlaneTexture, SceneTexture
from viewer.state.view_state import REFERENCE, DecodePath, MaterialView, Slot, ViewState

BLOCK = BlockConfig(block_words=(3, 8, 32), mean_words=8.0, modes=128, coefficients=88, output_channels=11, maps=MAPS)
GRID = GridConfig(hidden_width=12, positional_octaves=1, output_channels=11, maps=MAPS)
KINDS: tuple[tuple[MapName, ...], ...] = (MAPS, ("base", "normal", "occlusion"), ("normal", "roughness", "metalness"))
"""Maps of each texture of `random_block_pack`."""
NEUTRAL: dict[Plane, tuple[float, ...]] = {"surface": (0.5, 0.5, 1.0, 1.0), "emission": (1.0, 1.0, 1.0, 1.0)}
TURNED = (0.0, -0.5, 0.3, 0.5, 0.0, 0.1)
"""uv of a plane of the last cases: turned and shrunk."""
PATHS: tuple[DecodePath, ...] = ("deferred", "forward", "binned")


def set_of(width: int, height: int, maps: tuple[MapName, ...]) -> SceneTexture:
    """A material set of random pixels."""
    plain = texture(width, height, width)
    further: dict[MapName, NDArray[np.uint8]] = {
        name: noise(height, width, MAP_CHANNELS[name], width + place)
        for place, name in enumerate(maps)
        if name != "base"
    }
    return as_set(plain, maps, further, f"set {width} {height}")


def planes_of(number: int, maps: tuple[MapName, ...], layer: int) -> dict[str, PlaneTexture | None]:
    """How the material of a case finds the planes of texture `number`."""
    case = list(CASES.values())[layer]
    sampler = replace(case.sampler, wrap=case.wrap)
    transform = TURNED if layer == len(CASES) - 1 else (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    found: dict[str, PlaneTexture | None] = {}
    for plane, names in (("surface", MAPS[1:4]), ("emission", MAPS[4:])):
        own = tuple(name for name in maps if name in names)
        found[plane] = PlaneTexture(number, sampler, own, uv_transform=transform) if own else None
    return found


@pytest.fixture(scope="module")
def packs() -> dict[str, Pack]:
    """Of both codecs; groups of one pack differ from pixel to pixel, and one pack has one decoder."""
    hashes = [f"set {2 * w} {2 * h}" for w, h in SIZES]
    grid = random_pack(SIZES, (0, 1, 0), GRID, hashes)
    shapes = [(kind, sum(MAP_CHANNELS[name] for name in kind)) for kind in KINDS]
    sets = [
        replace(encoded, maps=kind, channels=channels)
        for encoded, (kind, channels) in zip(grid.textures, shapes, strict=True)
    ]
    return {
        "block": random_block_pack(SIZES, (0, 1, 0), BLOCK, hashes, maps=KINDS),
        "one decoder": random_block_pack(SIZES, (0, 0, 0), BLOCK, hashes, maps=KINDS),
        "grid": replace(grid, textures=tuple(sets)),
    }


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext, packs: dict[str, Pack]) -> Iterator[Renderer]:
    """All cases, one quad behind the other."""
    materials = []
    for layer, case in enumerate(CASES.values()):
        maps = KINDS[case.texture]
        planes = planes_of(case.texture, maps, layer)
        base = case.texture if "base" in maps else -1
        sampler = replace(case.sampler, wrap=case.wrap)
        materials.append(Material("m", base, WHITE, sampler, surface=planes["surface"], emission=planes["emission"]))
    parts = [case.map.quad(SIZE, layer, layer) for layer, case in enumerate(CASES.values())]
    textures = [set_of(2 * w, 2 * h, maps) for (w, h), maps in zip(SIZES, KINDS, strict=True)]
    made = Renderer(graphics, scene_of(parts, materials, textures))
    made.set_packs(packs)
    yield made
    made.release()


def expected_plane(pack: Pack, name: str, plane: Plane) -> NDArray[np.float64]:
    """[H * W, 4] what the plane's target holds of a case, but for the base colour's alpha."""
    case = CASES[name]
    texture_maps, uv, texels = KINDS[case.texture], case.map.uv(SIZE), SIZES[case.texture]
    lod = np.full(len(uv), case.map.lod(texels))
    if name == list(CASES)[-1] and plane != "base":
        a, b, c, d, e, f = TURNED
        uv = np.stack([a * uv[:, 0] + b * uv[:, 1] + c, d * uv[:, 0] + e * uv[:, 1] + f], axis=1)
        lod = lod + 0.5 * np.log2(abs(a * e - b * d))
    decoded = decode_filtered(pack, case.texture, uv, lod, replace(case.sampler, wrap=case.wrap))
    found = np.tile(np.array(NEUTRAL.get(plane, (1.0,) * 4)), (len(uv), 1))
    channels = plane_channels(texture_maps, decoded.shape[1]).get(plane, {})
    for component, channel in channels.items():
        found[:, component] = decoded[:, channel]
    if plane != "surface" and channels:
        colours = [component for component in channels if component < 3]
        found[:, colours] = srgb_to_linear(found[:, colours])
    return found


@pytest.mark.parametrize(("name", "kind", "path"), covering(list(CASES), ["block", "one decoder", "grid"], PATHS))
def test_planes_agree_with_float64(
    renderer: Renderer, packs: dict[str, Pack], name: str, kind: str, path: DecodePath
) -> None:
    slot = Slot(kind, path)
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, slot, material_view="lit"), whole=True)
    shown = renderer.planes(slot)
    assert set(shown) >= {"base", "surface"}
    for plane, pixels in shown.items():
        components = 3 if plane == "base" else 4
        expected = expected_plane(packs[kind], name, plane)[:, :components]
        error = np.abs(pixels.reshape(-1, 4)[:, :components] - expected).max()
        assert error <= 3.0 * TOLERANCE, f"{plane}: {error}"


@pytest.mark.computes
def test_compressed_textures_hold_the_same_planes(renderer: Renderer) -> None:
    """The texels are noise, of which compression keeps little more than the mean of a block."""
    camera, slot = straight_camera(list(CASES).index("one texel a pixel")), Slot("block", "on-load")
    renderer.render(ViewState(camera, SIZE, slot, material_view="lit"), whole=True)
    cached = renderer.planes(Slot("block", "cached"))
    for plane, pixels in renderer.planes(slot).items():
        assert np.abs(pixels - cached[plane]).mean() < 0.05, plane


@pytest.mark.parametrize("name", ["one texel a pixel", "lod 2, mirror and clamp", "any gradients"])
def test_cached_tiles_hold_the_same_planes(renderer: Renderer, name: str) -> None:
    kind, slot = "block", Slot("block", "cached")
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, slot, material_view="lit"), whole=True)
    deferred = renderer.planes(Slot(kind, "deferred"))
    for plane, pixels in renderer.planes(slot).items():
        # Tiles have 8 bits, and colours are filtered in linear light.
        assert np.abs(pixels - deferred[plane]).mean() < (0.004 if plane == "surface" else 0.05), plane


@pytest.mark.parametrize("path", ["deferred", "cached"])
def test_a_view_decodes_only_the_planes_it_shows(
    graphics: GraphicsContext, packs: dict[str, Pack], path: DecodePath
) -> None:
    planes = planes_of(0, MAPS, 0)
    material = Material("m", 0, WHITE, surface=planes["surface"], emission=planes["emission"])
    scene = scene_of([CASES["magnified"].map.quad(SIZE, 0, 0)], [material], [set_of(128, 128, MAPS)])
    renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": packs["block"]})
    wanted: dict[MaterialView, set[Plane]] = {
        "normal": {"surface"},
        "emissive": {"emission"},
        "orm": {"surface", "emission"},
        "base": {"base"},
        "lit": set(PLANES),
    }
    for view, decoded in wanted.items():
        frame = renderer.render(ViewState(straight_camera(0), SIZE, Slot("p", path), material_view=view), whole=True)
        assert set(renderer.decoded_planes(Slot("p", path))) == decoded
        assert frame.skipped["planes_not_drawn"] == 3 - len(decoded)
    again = renderer.render(ViewState(straight_camera(0), SIZE, Slot("p", path), material_view="lit"), whole=True)
    assert "shade" not in again.timings_ms, "at rest nothing is decoded or lit anew"
    assert f"decode_{path}" not in again.timings_ms
    renderer.release()


def test_original_images_hold_the_maps_as_they_are(renderer: Renderer) -> None:
    case = CASES["one texel a pixel"]
    renderer.render(ViewState(straight_camera(1), SIZE, material_view="lit"))
    shown = renderer.planes(Slot())
    texels = renderer.scene.textures[case.texture]
    # The image has twice the texels: a pixel shows its mip 1, and those before it are its own.
    assert texels.pixels.shape[:2] == (128, 128)
    places: list[tuple[Plane, MapName, int]] = [
        ("surface", "roughness", 2),
        ("surface", "metalness", 3),
        ("emission", "occlusion", 3),
    ]
    for plane, name, first in places:
        image = texels.further_maps[name].astype(np.float64)[..., 0] / 255.0
        halved = image.reshape(64, 2, 64, 2).mean(axis=(1, 3))
        window = np.array([[halved[y % 64, x] for x in range(SIZE[0])] for y in range(SIZE[1])])[::-1]
        np.testing.assert_allclose(shown[plane][..., first], window, atol=0.003)


def test_a_pack_of_base_colours_is_lit_with_the_other_maps_of_the_scene(graphics: GraphicsContext) -> None:
    planes = planes_of(0, MAPS, 0)
    material = Material("m", 0, WHITE, surface=planes["surface"], emission=planes["emission"])
    owner = set_of(64, 64, MAPS)
    renderer = Renderer(graphics, scene_of([CASES["magnified"].map.quad(SIZE, 0, 0)], [material], [owner]))
    renderer.set_packs({"p": random_block_pack([(64, 64)], (0,), BlockConfig(), [owner.pixel_hash])})
    renderer.render(ViewState(straight_camera(0), SIZE, Slot("p"), material_view="lit"), whole=True)
    assert renderer.decoded_planes(Slot("p")) == ("base",)
    own, original = renderer.planes(Slot("p")), renderer.planes(Slot(REFERENCE))
    np.testing.assert_array_equal(own["surface"], original["surface"])
    assert np.abs(own["base"] - original["base"]).max() > 0.1
    renderer.release()


@pytest.mark.parametrize("name", ["base", "normal", "roughness", "metalness", "emissive", "occlusion"])
def test_one_decoded_map_stands_among_the_original_ones(renderer: Renderer, name: ShownMap) -> None:
    layer = list(CASES).index("one texel a pixel")
    renderer.render(ViewState(straight_camera(layer), SIZE, Slot("block"), material_view="lit"), whole=True)
    original, decoded = renderer.picture(Slot()), renderer.picture(Slot("block"))
    single = renderer.picture(Slot("block", maps=name))
    if name == "emissive":
        # The material emits nothing, whatever its map says.
        np.testing.assert_array_equal(single, original)
        return
    assert np.abs(single - original).max() > 0.01
    assert np.abs(single - decoded).max() > 0.01


@pytest.mark.parametrize("kind", ["block", "grid"])
@pytest.mark.computes
def test_single_texels_have_all_channels(graphics: GraphicsContext, packs: dict[str, Pack], kind: str) -> None:
    pack, random = packs[kind], np.random.default_rng(5)
    decoder = GlTexelDecoder(graphics, pack)
    uv, lod = random.uniform(-2.0, 2.0, (50, 2)).astype(np.float32), random.uniform(-1.0, 6.0, 50).astype(np.float32)
    for index, encoded in enumerate(pack.textures):
        found = decoder.decode_texels(index, uv, lod)
        expected = decode_texels(pack, index, uv.astype(np.float64), lod.astype(np.float64))
        assert found.shape == (50, encoded.channels)
        np.testing.assert_allclose(found, expected, atol=TOLERANCE)
    decoder.release()
