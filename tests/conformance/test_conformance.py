"""Every decoder finds the same texels in small packs that use every feature of the formats; libntc stands what is not a pack."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.api import decode
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.universal import set_tables_path, tables_path
from ntc.codec.latents import latent_levels, texture_levels
from ntc.codec.maps import CODED_MAPS
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.metrics.block_compression import decode_bc, decode_bc5, encode_bc5, encode_bc7
from ntc.pack.file import read_pack
from tests.conformance.native import (
    BC4,
    BC4_QUICK,
    BC5,
    BC5_QUICK,
    BC7,
    BC7_QUICK,
    compiled,
    compressed,
    native_pack,
    opened,
)
from tests.conformance.packs import FOLDER, MAKERS, graphics, pixels, texels

PACKS = sorted(MAKERS)
HERE = Path(__file__).parent
BAD_ARGUMENT, BAD_FILE, UNSUPPORTED = 4, 2, 3


def expected(name: str) -> bytes:
    return (FOLDER / f"{name}.texels").read_bytes()


def tables_of(pack: Pack) -> bytes:
    """The shipped tables of a pack of grouping `universal`; of other packs nothing."""
    if pack.grouping.name != "universal":
        return b""
    if isinstance(pack.config, BlockConfig) and pack.config.tables is not None:
        return set_tables_path(pack.config.tables).read_bytes()
    return tables_path(int(pack.grouping.parameters["version"]), pack.config.output_channels).read_bytes()


def steps_apart(found: bytes, name: str) -> int:
    """Largest difference from the expected texels in steps of 1/255."""
    own, others = (np.frombuffer(data, np.uint8).astype(np.int64) for data in (found, expected(name)))
    assert own.shape == others.shape
    return int(np.abs(own - others).max())


@pytest.mark.parametrize("name", PACKS)
def test_the_reference_decodes_them(name: str) -> None:
    assert steps_apart(texels(read_pack(FOLDER / f"{name}.ntc")), name) == 0


@pytest.mark.parametrize("name", PACKS)
def test_torch_decodes_them(name: str) -> None:
    pack = read_pack(FOLDER / f"{name}.ntc")
    parts = [
        decode(pack, number, level, "torch").tobytes()
        for number, own in enumerate(pack.textures)
        for level in range(len(texture_levels(own, pack.config)))
    ]
    assert steps_apart(b"".join(parts), name) <= 1


@pytest.mark.gl
@pytest.mark.computes
@pytest.mark.parametrize("name", PACKS)
def test_glsl_decodes_them(name: str) -> None:
    from viewer.gl.context import create_headless_context
    from viewer.render.passes.decode_texels import GlTexelDecoder

    pack = read_pack(FOLDER / f"{name}.ntc")
    decoder = GlTexelDecoder(create_headless_context(), pack, "fp32")
    parts = [
        decoder.decode_image(number, level).tobytes()
        for number, own in enumerate(pack.textures)
        for level in range(len(texture_levels(own, pack.config)))
    ]
    assert steps_apart(b"".join(parts), name) <= 1


def native_image(pack: Pack, number: int, level: int, data: bytes) -> NDArray[np.uint8]:
    size = latent_levels(pack.textures[number].width, pack.textures[number].height, pack.config)[level]
    with native_pack(data, tables_of(pack)) as own:
        found = own.decode(number, level, 0, 0, size.texel_width, size.texel_height)
    assert not isinstance(found, int)
    return found


@pytest.mark.parametrize("name", PACKS)
def test_libntc_decodes_them(name: str) -> None:
    data, pack = (FOLDER / f"{name}.ntc").read_bytes(), read_pack(FOLDER / f"{name}.ntc")
    parts = [
        native_image(pack, number, level, data).tobytes()
        for number, own in enumerate(pack.textures)
        for level in range(len(texture_levels(own, pack.config)))
    ]
    assert steps_apart(b"".join(parts), name) <= 1


def test_libntc_tells_what_a_pack_holds() -> None:
    for name in ("block-textures", "block-sets", "block-coverage"):
        data, pack = (FOLDER / f"{name}.ntc").read_bytes(), read_pack(FOLDER / f"{name}.ntc")
        with native_pack(data) as own:
            for number, texture in enumerate(pack.textures):
                found = own.info(number)
                assert found.name.decode() == texture.name
                assert found.pixel_hash.decode() == texture.pixel_hash
                assert (found.width, found.height, found.channels) == (texture.width, texture.height, texture.channels)
                assert [CODED_MAPS[part] for part in found.maps[: found.map_count]] == list(texture.maps)
                assert [["repeat", "mirror", "clamp"][own_wrap] for own_wrap in found.wrap] == list(texture.wrap)
                assert bool(found.is_srgb) == (texture.color_space == "srgb")


@pytest.mark.parametrize("name", ["block-sets", "block-four-mips", "grid-adapters"])
def test_rectangles_and_floats_are_parts_of_the_whole(name: str) -> None:
    data, pack = (FOLDER / f"{name}.ntc").read_bytes(), read_pack(FOLDER / f"{name}.ntc")
    random = np.random.default_rng(5)
    with native_pack(data) as own:
        for number, texture in enumerate(pack.textures):
            for mip in range(own.info(number).mips):
                width, height = max(1, texture.width >> mip), max(1, texture.height >> mip)
                whole = own.decode(number, mip, 0, 0, width, height)
                floats = own.decode(number, mip, 0, 0, width, height, np.float32)
                assert not isinstance(whole, int)
                assert not isinstance(floats, int)
                assert np.abs(np.rint(floats * 255.0) - whole).max() <= 1
                for _ in range(4):
                    x, y = int(random.integers(width)), int(random.integers(height))
                    w, h = int(random.integers(1, width - x + 1)), int(random.integers(1, height - y + 1))
                    part = own.decode(number, mip, x, y, w, h)
                    np.testing.assert_array_equal(part, whole[y : y + h, x : x + w])


def test_what_is_not_there_is_refused() -> None:
    with native_pack((FOLDER / "block-textures.ntc").read_bytes()) as own:
        info = own.info(0)
        wrong = [(0, 0, -1, 0, 1, 1), (0, 0, 0, 0, info.width + 1, 1), (0, info.mips, 0, 0, 1, 1), (0, -1, 0, 0, 1, 1)]
        wrong += [(0, 0, 2**31 - 1, 0, 1, 1), (0, 0, 0, 1, 1, info.height), (0, 0, 0, 0, -1, 1)]
        assert [own.decode(*each) for each in wrong] == [BAD_ARGUMENT] * len(wrong)
        assert [own.status(number, 0) for number in (-1, 5)] == [BAD_ARGUMENT] * 2


def test_compressed_blocks_are_near_to_a_good_encoder() -> None:
    """BC7 with and without alpha, BC5 and BC4, beside quicktex at its best."""
    data, pack = (FOLDER / "block-sets.ntc").read_bytes(), read_pack(FOLDER / "block-sets.ntc")
    image = native_image(pack, 0, 0, data)
    height, width = image.shape[:2]
    with native_pack(data) as own:
        bc7, bc5, bc4 = own.blocks(0, 0, 0, BC7), own.blocks(0, 0, 1, BC5), own.blocks(0, 0, 2, BC4)
        quick_bc5, quick_bc4 = own.blocks(0, 0, 1, BC5_QUICK), own.blocks(0, 0, 2, BC4_QUICK)
    rgba = np.ascontiguousarray(image[..., :4])
    ours, best = (psnr_db(decode_bc(blocks, width, height, 7), rgba) for blocks in (bc7, encode_bc7(rgba, "thorough")))
    assert ours > best - 0.4
    normals = np.dstack([image[..., 4:6], np.zeros_like(image[..., :1]), np.full_like(image[..., :1], 255)])
    ours = psnr_db(decode_bc5(bc5, width, height)[..., :2], image[..., 4:6])
    best = psnr_db(decode_bc5(encode_bc5(np.ascontiguousarray(normals)), width, height)[..., :2], image[..., 4:6])
    assert ours > best - 0.1
    assert psnr_db(decode_bc5(quick_bc5, width, height)[..., :2], image[..., 4:6]) > best - 2.0
    for blocks in (bc4, quick_bc4):
        doubled = b"".join(blocks[at : at + 8] * 2 for at in range(0, len(blocks), 8))
        assert psnr_db(decode_bc5(doubled, width, height)[..., 0], image[..., 6]) > 40.0


@pytest.mark.parametrize("alpha", ["opaque", "apart", "with the colours", "of two values"])
@pytest.mark.parametrize("kind", ["noise", "graphics", "flat"])
def test_blocks_of_all_kinds_are_near_to_a_good_encoder(kind: str, alpha: str) -> None:
    shown = {"noise": pixels, "graphics": graphics}.get(
        kind, lambda *size: np.full((size[1], size[0], 3), 93, np.uint8)
    )
    colours = shown(64, 64, 3, 3)
    alphas = {
        "opaque": np.full((64, 64), 255, np.uint8),
        "apart": pixels(64, 64, 1, 9)[..., 0],
        "with the colours": colours[..., 1],
        "of two values": graphics(64, 64, 1, 8)[..., 0] // 128 * 255,
    }
    rgba = np.ascontiguousarray(np.dstack([colours, alphas[alpha]]).astype(np.uint8))
    blocks = rgba.reshape(16, 4, 16, 4, 4).transpose(0, 2, 1, 3, 4).reshape(-1, 64)
    found = [b"".join(compressed(block.tobytes(), form) for block in blocks) for form in (BC7, BC7_QUICK)]
    stored = (*found, encode_bc7(rgba, "thorough"))
    ours, quick, best = (psnr_db(decode_bc(each, 64, 64, 7), rgba) for each in stored)
    assert ours > min(best, 58.0) - 1.0
    assert quick > min(best, 45.0) - 1.0


def test_files_that_are_no_packs_are_refused_with_a_reason() -> None:
    data = (FOLDER / "block-sets.ntc").read_bytes()
    assert opened(b"")[:2] == (BAD_FILE, "it is no safetensors file")
    assert opened(data[:100])[:2] == (BAD_FILE, "it is no safetensors file")
    assert opened(data[:-1])[:2] == (BAD_FILE, "a tensor has no valid type, shape or place")
    assert opened(data + b"\0")[:2] == (BAD_FILE, "bytes are left over")
    universal = (FOLDER / "block-universal.ntc").read_bytes()
    assert opened(universal)[:2] == (UNSUPPORTED, "grouping universal needs its tables: give options.tables")
    sets = (FOLDER / "block-universal-sets.ntc").read_bytes()
    assert opened(sets)[:2] == (UNSUPPORTED, "the pack needs tables for whole materials: give options.tables")
    assert opened(sets, tables_path(2, 3).read_bytes())[0] == BAD_FILE


@pytest.mark.process
def test_changed_packs_are_refused_or_decoded_without_a_fault(tmp_path: Path) -> None:
    program = compiled(
        tmp_path / "fuzz",
        "-O1",
        "-g",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        sources=(HERE / "fuzz.c",),
    )
    packs = [FOLDER / f"{name}.ntc" for name in PACKS]
    done = subprocess.run([program, "4000", "1", *packs], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 1000 < int(done.stdout.split()[0]) < 3000
