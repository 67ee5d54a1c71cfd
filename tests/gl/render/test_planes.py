"""Material sets plane by plane: every decode path against the float64 codec, original images, and what a view leaves out."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.filtering import decode_filtered
from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.gpu import VariantName
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import MAP_CHANNELS, MAPS, PLANES, MapName, Plane, ShownMap, plane_channels
from ntc.codec.mips import srgb_to_linear
from ntc.codec.model import Pack
from tests.gl.render.test_block_frames import VARIANTS
from tests.gl.render.test_frame_parity import CASES, SIZE, SIZES, TOLERANCE
from tests.support.covering import covering
from tests.support.gltf_builder import noise
from tests.support.picture_scenes import QUAD, QUAD_UVS, WHITE, Part, as_set, scene_of, straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode import DecodePlanesPass
from viewer.render.renderer import Renderer
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.scene.model import Material, PlaneTexture, Sampler, Scene, SceneTexture
from viewer.state.view_state import REFERENCE, DecodePath, MaterialView, Slot, TexelFilter, ViewState

BLOCK = BlockConfig(block_words=(3, 8, 32), mean_words=8.0, modes=128, coefficients=88, output_channels=11, maps=MAPS)
GRID = GridConfig(hidden_width=12, positional_octaves=1, output_channels=11, maps=MAPS)
KINDS: tuple[tuple[MapName, ...], ...] = (MAPS, ("base", "normal", "occlusion"), ("normal", "roughness", "metalness"))
"""Maps of each texture of `random_block_pack`."""
NEUTRAL: dict[Plane, tuple[float, ...]] = {"surface": (0.5, 0.5, 1.0, 1.0), "emission": (1.0, 1.0, 1.0, 1.0)}
TURNED = (0.0, -0.5, 0.3, 0.5, 0.0, 0.1)
"""uv of a plane of the last cases: turned and shrunk."""
PATHS: tuple[DecodePath, ...] = ("deferred", "forward", "binned")
UvTransform = tuple[float, float, float, float, float, float]


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


def renderer_of_cases(graphics: GraphicsContext, packs: dict[str, Pack], variant: VariantName) -> Renderer:
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
    made = Renderer(graphics, scene_of(parts, materials, textures), variant=variant)
    made.set_packs(packs)
    return made


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext, packs: dict[str, Pack]) -> Iterator[Renderer]:
    """Each pixel decodes its codes for itself, plane by plane."""
    made = renderer_of_cases(graphics, packs, VARIANTS["alone"])
    yield made
    made.release()


@pytest.fixture(scope="module")
def joint(graphics: GraphicsContext, packs: dict[str, Pack]) -> Iterator[Renderer]:
    """Work groups decode codes together, all planes of a view in one pass."""
    made = renderer_of_cases(graphics, {"block": packs["block"]}, VARIANTS["together"])
    yield made
    made.release()


@cache
def decoded_once(pack: Pack, texture: int, uv: bytes, lod: float, sampler: Sampler) -> NDArray[np.float64]:
    """[H * W, channels] sRGB-coded: what the float64 codec says. Planes and renderers ask for the same."""
    places = np.frombuffer(uv).reshape(-1, 2)
    return decode_filtered(pack, texture, places, np.full(len(places), lod), sampler)


def expected_plane(pack: Pack, name: str, plane: Plane) -> NDArray[np.float64]:
    """[H * W, 4] what the plane's target holds of a case, but for the base colour's alpha."""
    case = CASES[name]
    texture_maps, uv, texels = KINDS[case.texture], case.map.uv(SIZE), SIZES[case.texture]
    lod = np.full(len(uv), case.map.lod(texels))
    if name == list(CASES)[-1] and plane != "base":
        a, b, c, d, e, f = TURNED
        uv = np.stack([a * uv[:, 0] + b * uv[:, 1] + c, d * uv[:, 0] + e * uv[:, 1] + f], axis=1)
        lod = lod + 0.5 * np.log2(abs(a * e - b * d))
    decoded = decoded_once(pack, case.texture, uv.tobytes(), float(lod[0]), replace(case.sampler, wrap=case.wrap))
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
    assert_planes_agree(renderer, packs[kind], name, Slot(kind, path))


def assert_planes_agree(renderer: Renderer, pack: Pack, name: str, slot: Slot) -> None:
    """All planes of a case, drawn in a lit view, are those of the float64 codec."""
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, slot, material_view="lit"), whole=True)
    shown = renderer.planes(slot)
    assert set(shown) >= {"base", "surface"}
    for plane, pixels in shown.items():
        components = 3 if plane == "base" else 4
        expected = expected_plane(pack, name, plane)[:, :components]
        error = np.abs(pixels.reshape(-1, 4)[:, :components] - expected).max()
        assert error <= 3.0 * TOLERANCE, f"{plane}: {error}"


@pytest.mark.computes
@pytest.mark.parametrize("name", CASES)
def test_planes_that_one_pass_decodes_agree_with_float64(joint: Renderer, packs: dict[str, Pack], name: str) -> None:
    with planes_decoded() as runs:
        assert_planes_agree(joint, packs["block"], name, Slot("block", "deferred"))
    assert [len(run) for run in runs] == [len(joint.planes(Slot("block", "deferred")))]


@contextmanager
def planes_decoded() -> Iterator[list[tuple[Plane, ...]]]:
    """The planes that each run of a DecodePlanesPass decodes within the block."""
    runs, run_all = list[tuple[Plane, ...]](), DecodePlanesPass.run_all

    def watched(own: DecodePlanesPass, wanted: Sequence[tuple[VisibilityInputs, ColorTarget]]) -> None:
        runs.append(tuple(inputs.plane for inputs, _ in wanted))
        run_all(own, wanted)

    with patch.object(DecodePlanesPass, "run_all", watched):
        yield runs


def mixed_scene() -> Scene:
    """Squares of 5 to 7 pixels of materials whose planes have the same or other textures, samplers and uv, or are missing."""
    own, other = Sampler(), Sampler(wrap=("mirror", "clamp"), magnify_linear=False)
    identity = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    kinds: list[tuple[int, tuple[int, Sampler, UvTransform] | None, tuple[int, Sampler, UvTransform] | None]] = [
        (0, (0, own, identity), (0, own, identity)),
        (1, (1, own, identity), (0, own, identity)),
        (0, (0, own, TURNED), (0, own, TURNED)),
        (0, None, (0, other, identity)),
        (-1, (2, own, identity), None),
        (1, None, None),
        (-1, None, (0, own, identity)),
        (0, (2, other, TURNED), (0, own, identity)),
    ]
    materials = [
        Material(
            f"m{number}",
            base,
            WHITE,
            surface=surface and PlaneTexture(surface[0], surface[1], MAPS[1:4], uv_transform=surface[2]),
            emission=emission and PlaneTexture(emission[0], emission[1], MAPS[4:], uv_transform=emission[2]),
        )
        for number, (base, surface, emission) in enumerate(kinds)
    ]
    parts = []
    for number in range(54):
        x, y = 0.33 * (number % 9) - 1.35, 0.33 * (number // 9) - 0.85
        positions = 0.165 * QUAD + np.array([x, y, 0.0], np.float32)
        # From magnified to mip 3.
        uvs = QUAD_UVS * np.float32(2.0 ** (number % 7 - 4)) + np.float32(0.1 * number)
        parts.append(Part(number % len(materials), positions, uvs))
    textures = [set_of(2 * w, 2 * h, maps) for (w, h), maps in zip(SIZES, KINDS, strict=True)]
    return scene_of(parts, materials, textures)


@pytest.mark.computes
@pytest.mark.parametrize("texel_filter", ["exact", "stochastic"])
def test_one_pass_decodes_what_passes_of_single_planes_do(
    graphics: GraphicsContext, packs: dict[str, Pack], texel_filter: TexelFilter
) -> None:
    scene, slot = mixed_scene(), Slot("p", "deferred", filter=texel_filter)
    views: list[tuple[MaterialView, bool]] = [("lit", False), ("normal", True), ("orm", True), ("lit", True)]
    found = []
    for variant in VARIANTS.values():
        renderer, planes = Renderer(graphics, scene, variant=variant), []
        renderer.set_packs({"p": packs["block"]})
        for view, whole in views:
            frame = renderer.render(ViewState(straight_camera(), SIZE, slot, material_view=view), whole)
            planes.append(renderer.planes(slot))
            assert set(frame.samples) == ({slot} if texel_filter == "stochastic" else set())
        assert renderer.covered().mean() > 0.9
        found.append(planes)
        renderer.release()
    alone, together = found
    for one, other in zip(alone, together, strict=True):
        assert one.keys() == other.keys()
        for plane, pixels in one.items():
            np.testing.assert_allclose(other[plane], pixels, atol=2e-5, err_msg=plane)


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
