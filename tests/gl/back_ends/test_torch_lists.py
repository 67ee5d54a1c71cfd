"""Tiles and pixels that torch decodes: the twin on the CPU against float64 and against GLSL, and what is refused without CUDA."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import moderngl
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.color import linear_to_srgb8
from ntc.codec.config import CodecConfig
from ntc.codec.maps import plane_channels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from ntc.errors import InputError
from tests.gl.small_scenes import ABOVE, FRONT, objects
from viewer import cli
from viewer.gl.context import GraphicsContext
from viewer.render.back_ends import cuda_lists, list_decoders
from viewer.render.back_ends.torch_lists import WRAP_MODES, CopiedBuffer, TorchListDecoder, make_lists
from viewer.render.renderer import Renderer
from viewer.render.resources.texel_lists import TEXEL_RECORD
from viewer.state.view_state import DecodePath, Precision, Slot, TexelFilter, ViewState

SIZES = ((64, 40), (17, 33))
CPU = torch.device("cpu")
FLOATS, HALVES = 2e-5, 0.5 / 255.0
"""How far from float64 texels may be: rounding of float32, and of sums in halves (random networks, values of order 1)."""
PACKS: dict[str, Callable[..., Pack]] = {
    "grid": partial(random_pack, config=CodecConfig()),
    "grid with adapters": partial(random_pack, config=CodecConfig(adapters=True)),
    "grid with output layers of its own": partial(random_pack, config=CodecConfig(adapters=True, adapter_output=True)),
    "block": random_block_pack,
}


@dataclass
class Rows:
    """A shared buffer without OpenGL."""

    content: torch.Tensor

    def read(self, rows: int) -> torch.Tensor:
        return self.content[:rows]

    def write(self, values: torch.Tensor) -> None:
        self.content = values

    def release(self) -> None:
        pass


def texel_list(count: int) -> NDArray[np.void]:
    """Texels of slot 1 and 3 of a table, in all wrap modes, some with nothing to decode."""
    random = np.random.default_rng(5)
    texels = np.zeros(count, TEXEL_RECORD)
    texels["u"], texels["v"] = random.integers(0, 1 << 32, (2, count))
    texels["lod"] = random.uniform(-1.0, 8.0, count)
    texels["lod"][:3] = np.nan, np.inf, -np.inf
    texels["texture_wrap"] = random.choice([1, 3], count) * 16 + random.integers(0, 3, (2, count)).T @ [4, 1]
    texels["texture_wrap"][::7] = -1
    return texels


@pytest.mark.once
@pytest.mark.parametrize("name", PACKS)
@pytest.mark.parametrize(("precision", "tolerance"), [("fp32", FLOATS), ("fp16", HALVES)])
def test_lists_are_the_float64_decode(name: str, precision: Precision, tolerance: float) -> None:
    pack = PACKS[name](SIZES, (0, 1))
    texels = texel_list(600)
    values = Rows(torch.zeros(0))
    decoder = TorchListDecoder(pack, (-1, 1, -1, 0), precision, CPU)
    decoder.decode(Rows(torch.from_numpy(texels.view(np.int32).reshape(-1, 4))), values, len(texels), "base")
    found = values.content.numpy()
    assert found.shape == (600, 4)
    assert not found[texels["texture_wrap"] < 0].any()
    at = np.stack([texels["u"], texels["v"]], axis=-1) * 2.0**-32
    for code in np.unique(texels["texture_wrap"][texels["texture_wrap"] >= 0]).tolist():
        index = {1: 1, 3: 0}[code >> 4]
        texture, own = pack.textures[index], texels["texture_wrap"] == code
        wrap = WRAP_MODES[code >> 2 & 3], WRAP_MODES[code & 3]
        lod = np.nan_to_num(texels["lod"][own], posinf=0.0, neginf=0.0)
        expected = decode_texels(pack, index, at[own], lod, wrap)
        places = plane_channels(texture.maps, texture.channels)["base"]
        np.testing.assert_allclose(found[own][:, list(places)], expected[:, list(places.values())], atol=tolerance)


def packs_of_objects(seed: int = 0) -> dict[str, Pack]:
    """Two codecs, two decoders each."""
    textures = objects().textures
    sizes, hashes = [(t.pixels.shape[1], t.pixels.shape[0]) for t in textures], [t.pixel_hash for t in textures]
    config = CodecConfig(adapters=True)
    return {
        "grid": random_pack(sizes, (0, 1, 0, 1), hashes=hashes, seed=seed, config=config),
        "block": random_block_pack(sizes, (0, 1, 0, 1), hashes=hashes, seed=seed),
    }


def pictures(renderer: Renderer, slot: Slot) -> NDArray[np.uint8]:
    """[2, H, W, 3] 8-bit sRGB."""
    found = []
    for camera in (FRONT, ABOVE):
        renderer.render(ViewState(camera, (120, 72), slot), whole=True)
        found.append(linear_to_srgb8(renderer.picture(slot)))
    return np.stack(found)


def assert_same_pictures(found: NDArray[np.uint8], expected: NDArray[np.uint8]) -> None:
    """99.9 % of the pixels within a step."""
    assert expected.std() > 10.0
    steps = np.abs(found.astype(int) - expected).max(axis=-1)
    assert (steps <= 1).mean() >= 0.999, np.bincount(steps.ravel())


@pytest.mark.parametrize("source", ["grid", "block"])
@pytest.mark.parametrize(
    ("path", "texel_filter", "precision"),
    [
        ("cached", "exact", "fp32"),
        ("cached", "exact", "fp16"),
        ("binned", "exact", "fp32"),
        ("binned", "exact", "fp16"),
        ("binned", "stochastic", "fp32"),
    ],
)
@pytest.mark.computes
def test_pictures_are_those_of_glsl(
    graphics: GraphicsContext, source: str, path: DecodePath, texel_filter: TexelFilter, precision: Precision
) -> None:
    slot = Slot(source, path, precision, texel_filter)
    shown = []
    for lists in (None, make_lists()):
        renderer = Renderer(graphics, objects(), list_decoders=lists)
        renderer.set_packs({source: packs_of_objects()[source]})
        shown.append(pictures(renderer, slot))
        renderer.release()
    assert_same_pictures(shown[1], shown[0])


@pytest.mark.parametrize("path", ["cached", "binned"])
@pytest.mark.computes
def test_another_version_of_a_pack_is_decoded(graphics: GraphicsContext, path: DecodePath) -> None:
    slot, shown = Slot("grid", path), []
    for lists in (None, make_lists()):
        renderer = Renderer(graphics, objects(), list_decoders=lists)
        renderer.set_packs({"grid": packs_of_objects()["grid"]})
        before = pictures(renderer, slot)
        renderer.update_pack("grid", packs_of_objects(seed=9)["grid"])
        shown.append(pictures(renderer, slot))
        assert (shown[-1] != before).mean() > 0.3
        renderer.release()
    assert_same_pictures(shown[1], shown[0])


def test_many_texels_are_listed_in_parts(graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    slot, shown = Slot("grid", "binned"), []
    for most in (1 << 18, 1000):
        monkeypatch.setattr("viewer.render.resources.texel_lists.LIST_TEXELS", most)
        renderer = Renderer(graphics, objects(), list_decoders=make_lists())
        renderer.set_packs({"grid": packs_of_objects()["grid"]})
        shown.append(pictures(renderer, slot))
        renderer.release()
    np.testing.assert_array_equal(shown[0], shown[1])


def test_without_cuda_the_option_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    out = ["render", "--out", str(tmp_path / "o"), "--size", "32x18"]
    for arguments, word in (
        (["--path", "cached", "--decode-with", "torch"], "finds no CUDA device"),
        (["--decode-with", "torch-cpu"], "only --path cached and binned"),
    ):
        capsys.readouterr()
        assert cli.main([*out, *arguments]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert word in lines[-1]
        assert lines[-1].startswith("error: ")
        assert not (tmp_path / "o").exists()
    assert list_decoders("glsl") is None


class Runtime:
    """Stands in for cuda-python: what it is asked, in order; registering fails where there is no `resource`."""

    def __init__(self, resource: str | None) -> None:
        self.resource = resource
        self.asked: list[str] = []

    def cudaGraphicsGLRegisterBuffer(self, *_arguments: Any) -> tuple[Any, ...]:  # noqa: N802
        return (0, self.resource) if self.resource else (999, None)

    def __getattr__(self, name: str) -> Any:
        def call(*_arguments: Any) -> tuple[Any, ...]:
            self.asked.append(name)
            return (0, 4096, 64) if name.endswith("Pointer") else (0,)

        return call


def test_buffers_that_cuda_cannot_have_are_copied(graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    buffer = graphics.memory.buffer("a test", np.arange(8, dtype=np.int32).tobytes())
    for runtime in (None, Runtime(None)):
        monkeypatch.setattr(cuda_lists, "cuda_runtime", lambda found=runtime: found)
        shared = cuda_lists._share(buffer, CPU)
        assert isinstance(shared, CopiedBuffer)
        assert shared.read(2).tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]]
    shared.write(torch.ones((1, 4)))
    assert np.frombuffer(buffer.read(), np.float32)[:4].tolist() == [1.0] * 4
    buffer.release()


def test_a_mapped_buffer_is_given_back_after_each_copy(
    graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    buffer: moderngl.Buffer = graphics.memory.buffer("a test", bytes(64))
    memory, runtime = torch.arange(16, dtype=torch.int32).view(4, 4), Runtime("resource")
    monkeypatch.setattr(torch.cuda, "current_stream", lambda _device: type("Stream", (), {"cuda_stream": 0}))
    monkeypatch.setattr(torch, "as_tensor", lambda found, device: memory[: found.__cuda_array_interface__["shape"][0]])
    mapped = cuda_lists.MappedBuffer(buffer, CPU, runtime)
    read = mapped.read(2)
    mapped.write(torch.zeros((1, 4)))
    mapped.release()
    assert read.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert memory[0].tolist() == [0, 0, 0, 0]
    copy = ["cudaGraphicsMapResources", "cudaGraphicsResourceGetMappedPointer", "cudaGraphicsUnmapResources"]
    assert runtime.asked == [*copy, *copy, "cudaGraphicsUnregisterResource"]
    with pytest.raises(RuntimeError, match="CUDA: 999"):
        cuda_lists.MappedBuffer(buffer, CPU, Runtime(None))
    buffer.release()


def test_torch_missing_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_torch(_name: str) -> Any:
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    monkeypatch.setattr("importlib.import_module", no_torch)
    with pytest.raises(InputError, match=r"decoding with torch: torch is not installed; pip install"):
        list_decoders("torch")
