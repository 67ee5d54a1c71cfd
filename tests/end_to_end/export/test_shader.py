"""`ntc-viewer export --shader`: decoders in other languages compile, and decode what the float64 reference does."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.config import WrapMode
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import MAPS, Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from ntc.pack.file import write_pack
from viewer import cli
from viewer.export import ShaderLanguage

TEXELS = 3_000
TOLERANCE = 1e-4
pytestmark = pytest.mark.guards("exports")
SIZES = ((256, 128), (40, 24), (17, 33))
WRAP_MODES: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
MATERIALS = BlockConfig(maps=MAPS, output_channels=11, block_words=(4, 8, 12), coefficients=120, modes=16)
PACKS: dict[str, Callable[[], Pack]] = {
    "grid": lambda: random_pack(SIZES),
    "block": lambda: random_block_pack(SIZES),
    "materials": lambda: random_block_pack(SIZES, config=MATERIALS),
}
VARIANTS: dict[str, Callable[[], Pack]] = {
    "grid of 4-bit latents with adapters": lambda: random_pack(
        config=GridConfig(
            latent_channels=8, latent_bits=4, hidden_width=16, adapters=True, adapter_output=True, weight_bits=16
        )
    ),
    "grid of one level and one channel": lambda: random_pack(
        config=GridConfig(levels=1, output_channels=1, hidden_width=16)
    ),
    "grid of 4 channels with adapters": lambda: random_pack(
        config=GridConfig(output_channels=4, hidden_width=16, adapters=True)
    ),
    "block of 4x4 texels, one size, 4 channels": lambda: random_block_pack(
        config=BlockConfig(block_side=4, block_words=(3,), coefficients=24, modes=8, output_channels=4)
    ),
    "block of one channel": lambda: random_block_pack(config=BlockConfig(output_channels=1, coefficients=48)),
}
REQUESTS = np.dtype([("uv", "<f4", (2,)), ("lod", "<f4"), ("texture", "<i4"), ("wrap", "<i4", (2,))])
CUDA_KERNEL = """
extern "C" __global__ void decode(const unsigned int* words, unsigned int count, float4* found) {
    const ntc::vec4 value = ntc::decoder{words, count}.decode_base(0, ntc::vec2(0.5f), 0.0f, ntc::ivec2(0));
    found[threadIdx.x] = make_float4(value.x, value.y, value.z, value.w);
}
"""
GLSL_MAIN = """layout(std430, binding = 1) buffer Found { vec4 found[]; };
void main() { found[0] = ntc_decode_base(0, vec2(0.5), 0.0, ivec2(0)); }"""
HLSL_MAIN = """RWStructuredBuffer<float4> found : register(u1);
[numthreads(1, 1, 1)] void main() { found[0] = ntc_decode_base(0, float2(0.5, 0.5), 0.0, int2(0, 0)); }"""


@dataclass(frozen=True)
class Exported:
    """A pack, and the folder of its decoder."""

    pack: Pack
    folder: Path

    def text(self, name: str) -> str:
        """A file."""
        return (self.folder / name).read_text(encoding="utf-8")


def exported(pack: Pack, folder: Path, language: ShaderLanguage) -> Exported:
    """The decoder of `pack` as the command line writes it."""
    path, out = folder / "pack.ntc", folder / "decoder"
    write_pack(path, pack)
    assert cli.main(["export", "--shader", language, "--pack", str(path), "--out", str(out)]) == 0
    return Exported(pack, out)


def requests_for(pack: Pack, count: int) -> NDArray[Any]:
    """[count] REQUESTS all over the textures and beyond, in all wrap modes; some at the centres of texels."""
    random = np.random.default_rng(5)
    found = np.zeros(count, REQUESTS)
    found["uv"] = random.uniform(-1.5, 2.5, (count, 2))
    found["uv"][::7] = (np.floor(found["uv"][::7] * 32.0) + 0.5) / 32.0
    found["lod"] = random.uniform(-1.0, 7.0, count)
    found["lod"][::3] = np.rint(found["lod"][::3])
    found["texture"] = random.integers(0, len(pack.textures), count)
    found["wrap"] = random.integers(0, len(WRAP_MODES), (count, 2))
    return found


def expected_texels(pack: Pack, plane: Plane, requests: NDArray[Any]) -> NDArray[np.float64]:
    """[N, 4] in float64; NaN for components that a texture lacks."""
    expected = np.full((len(requests), 4), np.nan)
    for index, texture in enumerate(pack.textures):
        components = plane_channels(texture.maps, texture.channels).get(plane, {})
        for u, first in enumerate(WRAP_MODES):
            for v, second in enumerate(WRAP_MODES):
                own = np.flatnonzero((requests["texture"] == index) & (requests["wrap"] == (u, v)).all(axis=1))
                uv, lod = requests["uv"][own].astype(np.float64), requests["lod"][own].astype(np.float64)
                values = decode_texels(pack, index, uv, lod, (first, second))
                expected[own[:, None], list(components)] = values[:, list(components.values())]
    return expected


@dataclass(frozen=True)
class Compared:
    """What decoders of one pack are asked, and what the float64 reference answers."""

    pack: Pack
    requests: dict[Plane, NDArray[Any]]
    expected: dict[Plane, NDArray[np.float64]]

    @classmethod
    def of(cls, pack: Pack, count: int) -> "Compared":
        """`count` texels, the same number of each plane."""
        planes = tuple(plane_channels(pack.config.maps, pack.config.output_channels))
        parts = dict(zip(planes, np.array_split(requests_for(pack, count), len(planes)), strict=True))
        return cls(pack, parts, {plane: expected_texels(pack, plane, part) for plane, part in parts.items()})

    def check(self, plane: Plane, found: NDArray[np.float32]) -> None:
        """`found` [N, 4] is what the reference gives."""
        error = np.abs(found - self.expected[plane])
        assert np.isfinite(found).all()
        assert np.isfinite(error).any()
        assert np.nanmax(error) <= TOLERANCE, plane


@pytest.fixture(
    scope="module",
    params=PACKS,
)
def compared(request: pytest.FixtureRequest) -> Compared:
    return Compared.of(PACKS[request.param](), TEXELS)


def reference_program(folder: Path, *options: str) -> Path:
    """The program of a folder, compiled without a warning."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++: apt-get install g++")
    program = folder.parent / "ntc_reference"
    command = [compiler, "-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", *options]
    built = subprocess.run(
        [*command, "-o", program, folder / "ntc_reference.cpp"], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    return program


def run_program(program: Path, data: Path, plane: Plane, requests: NDArray[Any]) -> NDArray[np.float32]:
    """[N, 4] of what it prints."""
    lines = (
        f"{own['texture']} {plane} {own['uv'][0]:.9g} {own['uv'][1]:.9g} {own['lod']:.9g} {own['wrap'][0]} {own['wrap'][1]}"
        for own in requests
    )
    done = subprocess.run([program, data], input="\n".join(lines), capture_output=True, text=True, check=True)
    return np.array(done.stdout.split(), np.float32).reshape(-1, 4)


@pytest.mark.process
def test_the_program_in_cpp_decodes_what_the_reference_does(compared: Compared, tmp_path: Path) -> None:
    own = exported(compared.pack, tmp_path, "glsl")
    program = reference_program(own.folder)
    for plane, requests in compared.requests.items():
        compared.check(plane, run_program(program, own.folder / "ntc_pack.bin", plane, requests))


@pytest.mark.process
def test_wgsl_decodes_what_the_reference_does(compared: Compared, tmp_path: Path) -> None:
    wgpu, device = webgpu_device()
    own = exported(compared.pack, tmp_path, "wgsl")
    for plane, requests in compared.requests.items():
        compared.check(plane, run_wgsl(wgpu, device, own, plane, requests))


def webgpu_device() -> tuple[Any, Any]:
    """The package wgpu and a device; tests skip without them."""
    wgpu = pytest.importorskip("wgpu", reason="WGSL is run by wgpu: pip install wgpu")
    try:
        return wgpu, wgpu.gpu.request_adapter_sync().request_device_sync()
    except (RuntimeError, AttributeError) as error:
        pytest.skip(f"there is no Vulkan device: apt-get install mesa-vulkan-drivers ({error})")


def run_wgsl(wgpu: Any, device: Any, own: Exported, plane: Plane, requests: NDArray[Any]) -> NDArray[np.float32]:
    """[N, 4] of what a compute shader around the exported decoder writes."""
    main = f"""
struct Request {{ uv_x: f32, uv_y: f32, lod: f32, texture_number: i32, wrap_u: i32, wrap_v: i32 }};
@group(0) @binding(1) var<storage, read> requests: array<Request>;
@group(0) @binding(2) var<storage, read_write> found: array<vec4<f32>>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    if (id.x >= arrayLength(&requests)) {{ return; }}
    let own = requests[id.x];
    let uv = vec2<f32>(own.uv_x, own.uv_y);
    found[id.x] = ntc_decode_{plane}(own.texture_number, uv, own.lod, vec2<i32>(own.wrap_u, own.wrap_v));
}}"""
    module = device.create_shader_module(code=own.text("ntc_decode.wgsl") + main)
    storage = wgpu.BufferUsage.STORAGE
    buffers = [
        device.create_buffer_with_data(data=(own.folder / "ntc_pack.bin").read_bytes(), usage=storage),
        device.create_buffer_with_data(data=requests.tobytes(), usage=storage),
        device.create_buffer(size=16 * len(requests), usage=storage | wgpu.BufferUsage.COPY_SRC),
    ]
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})
    entries = [{"binding": number, "resource": {"buffer": buffer}} for number, buffer in enumerate(buffers)]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
    encoder = device.create_command_encoder()
    compute = encoder.begin_compute_pass()
    compute.set_pipeline(pipeline)
    compute.set_bind_group(0, group)
    compute.dispatch_workgroups(-(-len(requests) // 64))
    compute.end()
    device.queue.submit([encoder.finish()])
    return np.frombuffer(device.queue.read_buffer(buffers[2]), np.float32).reshape(-1, 4)


@pytest.mark.parametrize("kind", [*PACKS, *VARIANTS])
def test_glslang_accepts_glsl_and_hlsl(kind: str, tmp_path: Path) -> None:
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("there is no glslangValidator: apt-get install glslang-tools")
    pack = {**PACKS, **VARIANTS}[kind]()
    glsl = exported(pack, tmp_path, "glsl").text("ntc_decode.glsl")
    hlsl = exported(pack, tmp_path, "hlsl").text("ntc_decode.hlsl")
    (tmp_path / "a.comp").write_text(
        f"#version 430\nlayout(local_size_x = 1) in;\n{glsl}\n{GLSL_MAIN}\n", encoding="utf-8"
    )
    (tmp_path / "b.hlsl").write_text(f"{hlsl}\n{HLSL_MAIN}\n", encoding="utf-8")
    for options in (["a.comp"], ["-D", "-V", "-S", "comp", "-e", "main", "-o", "b.spv", "b.hlsl"]):
        done = subprocess.run([compiler, *options], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
        assert "WARNING" not in done.stdout


@pytest.mark.process
@pytest.mark.parametrize("kind", list(VARIANTS))
def test_every_shape_of_a_codec_is_decoded_alike(kind: str, tmp_path: Path) -> None:
    own = exported(VARIANTS[kind](), tmp_path, "cuda")
    program = reference_program(own.folder)
    few = Compared.of(own.pack, 2000)
    for plane, requests in few.requests.items():
        few.check(plane, run_program(program, own.folder / "ntc_pack.bin", plane, requests))


@pytest.mark.parametrize("kind", list(PACKS))
def test_cuda_is_compiled(kind: str, tmp_path: Path) -> None:
    if find_spec("nvidia") is None or find_spec("nvidia.cuda_nvrtc") is None:
        pytest.skip("CUDA is compiled by NVRTC: pip install nvidia-cuda-nvrtc-cu12")
    spec = find_spec("nvidia.cuda_nvrtc")
    assert spec is not None
    folder = Path(next(iter(spec.submodule_search_locations or [])))
    library = ctypes.CDLL(str(next(iter(sorted(folder.rglob("libnvrtc.so*"))))))
    source = exported(PACKS[kind](), tmp_path, "cuda").text("ntc_decode.cuh") + CUDA_KERNEL
    program = ctypes.c_void_p()
    assert library.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"ntc.cu", 0, None, None) == 0
    options = (ctypes.c_char_p * 1)(b"--std=c++17")
    status = library.nvrtcCompileProgram(program, 1, options)
    size = ctypes.c_size_t()
    library.nvrtcGetProgramLogSize(program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    library.nvrtcGetProgramLog(program, log)
    assert status == 0, log.value.decode()


@pytest.mark.process
def test_damaged_data_is_told_in_a_line(tmp_path: Path) -> None:
    own = exported(random_block_pack(), tmp_path, "glsl")
    program = reference_program(own.folder, "-std=c++20", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    data = (own.folder / "ntc_pack.bin").read_bytes()
    for wrong in (tmp_path, tmp_path / "none.bin"):
        done = subprocess.run([program, wrong], input="", capture_output=True, text=True, check=False)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    random = np.random.default_rng(2)
    spoilt = tmp_path / "spoilt.bin"
    requests = "\n".join(
        f"{texture} base {u} 0.4 {lod} 0 1" for texture in (0, 1, 2) for u in (0.1, 0.9) for lod in (0, 1.5)
    )
    for number in range(30):
        words = np.frombuffer(data, "<u4").copy()
        # Half of them in the records, where places stand.
        place = random.integers(0, 200 if number % 2 else len(words))
        words[place] = random.choice(np.array([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, random.integers(0, 1 << 32)]))
        spoilt.write_bytes(words.tobytes() if number % 10 else data[: random.integers(0, len(data))])
        done = subprocess.run([program, spoilt], input=requests, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 2), done.stderr
        assert len(done.stderr.splitlines()) == (1 if done.returncode else 0), done.stderr
