"""Assembling and compiling GLSL: every shader, includes once, defines, errors with file and line."""

import re
from itertools import product
from pathlib import Path

import moderngl
import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.gpu import SOFTWARE, DecodingBinding, DecodingImage, DecodingUniform
from ntc.codec.grid.model import GridConfig
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderError, ShaderLibrary, set_uniforms
from viewer.locations import shaders_folder
from viewer.render.passes.pose_vertices import PoseBinding
from viewer.render.resources.clusters import ClusterBinding
from viewer.render.resources.layout import (
    BinBinding,
    ImageUnit,
    StorageBinding,
    TextureUnit,
    TileBinding,
    UniformBinding,
    scene_includes,
)
from viewer.render.resources.pack_buffers import codec_programs
from viewer.render.resources.visibility_buffer import SurfaceContent

SMALL = GridConfig(hidden_width=8, positional_octaves=1)
PRECISIONS = [{"PRECISION_FP16": 0}, {"PRECISION_FP16": 1}]
DRAWN = [
    (
        "common/scene.vert",
        "passes/visibility/visibility.frag",
        {**SurfaceContent(*content).defines(), "ALPHA_TEST": alpha},
    )
    for content in product((False, True), repeat=4)
    for alpha in (0, 1)
] + [
    ("common/scene.vert", "passes/decode_forward/decode.frag", {"VERTEX_COLORS": colors, **precision})
    for colors in (0, 1)
    for precision in PRECISIONS
]
FULL_SCREEN = [
    *[
        (
            "common/fullscreen.vert",
            "passes/composite/composite.frag",
            {"SPLIT": split, "DIFFERENCE": difference, "OVERLAY": overlay, "MARKS": marks, "ZOOM": zoom},
        )
        for split, difference in ((0, 0), (1, 0), (0, 1), (0, 2), (0, 3))
        for overlay, marks in ((0, 0), (1, 0), (0, 1))
        for zoom in (0, 1)
    ],
    *(
        ("common/fullscreen.vert", "passes/decode_cached/sample.frag", {"GRADIENTS": gradients, **precision})
        for gradients in (0, 1)
        for precision in PRECISIONS
    ),
    ("common/fullscreen.vert", "passes/divergence/divergence.frag", {"BLOCK_WIDTH": 16, "BLOCK_HEIGHT": 4}),
    *(
        ("common/fullscreen.vert", "passes/reference/sample.frag", {"GRADIENTS": a, "FIRST": first, "SORTS": sorts})
        for a in (0, 1)
        for first, sorts in ((1, 0), (1, 1), (0, 0))
    ),
]
PLANES_READ = [
    {
        "MIXED": mixed,
        "SURFACE_PLANE": 1,
        "EMISSION_PLANE": 1,
        "OTHER_SURFACE_PLANE": mixed,
        "OTHER_EMISSION_PLANE": mixed,
    }
    for mixed in (0, 1)
] + [{"MIXED": 0, "SURFACE_PLANE": 0, "EMISSION_PLANE": 0}]
LIT = ("TONE_MAP", "SUN", "SHADOWS", "LIGHTS", "CLEARCOAT", "SPECULAR", "EMISSIVE", "UNLIT")
FULL_SCREEN += [
    ("common/fullscreen.vert", "passes/shade/shade.frag", {**planes, **dict(zip(LIT, values, strict=True))})
    for planes in PLANES_READ
    for values in ((0,) * 8, (1, 1, 1, 0, 0, 1, 0, 1), (2, 1, 0, 1, 1, 0, 1, 0))
]
FULL_SCREEN += [
    ("common/fullscreen.vert", "passes/shade/show_map.frag", {**planes, "VIEW": view})
    for planes in PLANES_READ
    for view in range(3)
]
FULL_SCREEN += [
    ("common/fullscreen.vert", "passes/shade/background.frag", {"TONE_MAP": tones, "SUN_DISK": tones % 2})
    for tones in range(3)
]
FULL_SCREEN += [
    ("common/fullscreen.vert", f"passes/{name}.frag", {})
    for name in ("accumulate/accumulate", "prefilter/source", "prefilter/convolve")
]
DRAWN += [("common/scene.vert", "passes/shadow/shadow.frag", {"ALPHA_TEST": alpha}) for alpha in (0, 1)]
COMPUTED = [
    (name, precision)
    for name in ("passes/decode_deferred/decode.comp", "passes/decode_texels/decode.comp")
    for precision in PRECISIONS
]
COMPUTED += [
    (name, {**precision, "DECODER_PLACE": place})
    for name in (
        "passes/decode_deferred/decode_shared.comp",
        "passes/decode_binned/decode.comp",
    )
    for precision in PRECISIONS
    for place in (0, 1)
]
COMPUTED += [
    ("passes/decode_cached/decode.comp", {**precision, "DECODER_PLACE": place, "BY_SQUARES": 0})
    for precision in PRECISIONS
    for place in (0, 1)
]
COMPUTED += [
    (f"passes/decode_binned/{name}.comp", {"PRECISION_FP16": 0, "VERTEX_COLORS": 1})
    for name in ("count", "scan", "scatter")
]
COMPUTED += [
    ("passes/decode_cached/invalidate.comp", {}),
    ("passes/decode_cached/request.comp", {"PRECISION_FP16": 0, "GRADIENTS": 0}),
    ("passes/decode_cached/request.comp", {"PRECISION_FP16": 0, "GRADIENTS": 1}),
    ("passes/needed_levels/needed_levels.comp", {"PRECISION_FP16": 0}),
]
COMPUTED += [
    (f"passes/decode_{name}.comp", {"PRECISION_FP16": 0, "FILTER_STOCHASTIC": 1})
    for name in ("deferred/decode", "deferred/decode_shared", "binned/decode")
]
COMPUTED += [("passes/divergence/divergence.comp", {"BLOCK_WIDTH": 8, "BLOCK_HEIGHT": 8})]
ALL_GLSL = sorted(
    path.relative_to(shaders_folder()).as_posix() for path in shaders_folder().rglob("*") if path.is_file()
)


@pytest.fixture(scope="module")
def programs(graphics: GraphicsContext) -> ProgramFactory:
    """The shaders with the includes of a small codec."""
    library = ShaderLibrary(shaders_folder(), scene_includes())
    return codec_programs(ProgramFactory(graphics.gl, library), random_pack([(4, 4)], (0,), SMALL), SOFTWARE)


@pytest.mark.parametrize(("vertex", "fragment", "defines"), DRAWN + FULL_SCREEN)
def test_drawing_programs_compile(
    programs: ProgramFactory, vertex: str, fragment: str, defines: dict[str, int]
) -> None:
    assert programs.program(vertex, fragment, defines).glo > 0


@pytest.mark.parametrize(("name", "defines"), COMPUTED)
def test_compute_programs_compile(programs: ProgramFactory, name: str, defines: dict[str, int]) -> None:
    assert programs.compute(name, defines).glo > 0


@pytest.mark.parametrize(
    "config",
    [
        GridConfig(latent_channels=16, hidden_width=4, output_channels=1, positional_octaves=8),
        GridConfig(levels=1, hidden_width=12, output_channels=2, leaky_slope=0.0),
        GridConfig(hidden_width=16, adapters=True),
        GridConfig(hidden_width=16, latent_channels=12, latent_bits=4, adapters=True, adapter_output=True),
    ],
)
def test_other_codec_shapes_compile(graphics: GraphicsContext, config: GridConfig) -> None:
    library = ShaderLibrary(shaders_folder(), scene_includes())
    shaped = codec_programs(ProgramFactory(graphics.gl, library), random_pack([(4, 4)], (0,), config), SOFTWARE)
    assert shaped.compute("passes/decode_texels/decode.comp", {"PRECISION_FP16": 0}).glo > 0
    shaped.release()


def test_paths_compile_for_codec_block(graphics: GraphicsContext) -> None:
    library = ShaderLibrary(shaders_folder(), scene_includes())
    factory = ProgramFactory(graphics.gl, library)
    shaped = codec_programs(factory, random_block_pack([(4, 4)], (0,), BlockConfig(modes=8)), SOFTWARE)
    for in_image, stochastic in ((0, 0), (1, 0), (1, 1)):
        defines = {"VERTEX_COLORS": 1, "WEIGHTS_IN_IMAGE": in_image, "FILTER_STOCHASTIC": stochastic}
        for name in ("deferred/decode", "deferred/decode_shared", "binned/decode", "cached/decode", "texels/decode"):
            assert shaped.compute(f"passes/decode_{name}.comp", defines).glo > 0
        assert shaped.program("common/scene.vert", "passes/decode_forward/decode.frag", defines).glo > 0
    factory.release()


def test_bindings_come_from_the_layout() -> None:
    known = (
        {f"BINDING_{b.name}" for b in (*DecodingBinding, *StorageBinding, *BinBinding, *TileBinding)}
        | {f"BINDING_{b.name}" for b in (*ClusterBinding, *PoseBinding)}
        | {f"UNIT_{u.name}" for u in TextureUnit}
        | {f"IMAGE_{i.name}" for i in (*DecodingImage, *ImageUnit)}
        | {f"UNIFORM_{u.name}" for u in (*DecodingUniform, *UniformBinding)}
    )
    used = set()
    for name in ALL_GLSL:
        used |= set(re.findall(r"binding\s*=\s*(\w+)", (shaders_folder() / name).read_text()))
    assert used == known


@pytest.mark.computes
def test_storage_blocks_and_samplers_sit_at_their_python_numbers(programs: ProgramFactory) -> None:
    decode = programs.compute("passes/decode_texels/decode.comp", {"PRECISION_FP16": 0})
    bindings: dict[str, int] = {own.name: own for own in (*DecodingBinding, *StorageBinding)}
    blocks = {"Textures": "TEXTURES", "Levels": "LEVELS", "Latents": "LATENTS", "Weights": "WEIGHTS"}
    for block, binding in {**blocks, "Requests": "REQUESTS", "Results": "RESULTS"}.items():
        member = decode[block]
        assert isinstance(member, moderngl.StorageBlock)
        assert member.binding == bindings[binding]
    defines = dict.fromkeys(("DIFFERENCE", "OVERLAY", "MARKS", "ZOOM"), 0) | {"SPLIT": 1}
    composite = programs.program("common/fullscreen.vert", "passes/composite/composite.frag", defines)
    for name, unit in (("picture_a", TextureUnit.PICTURE_A), ("picture_b", TextureUnit.PICTURE_B)):
        sampler = composite[name]
        assert isinstance(sampler, moderngl.Uniform)
        assert sampler.value == unit


def library_of(**files: str) -> ShaderLibrary:
    """A library of files in memory; `__` in a name stands for the dot."""
    return ShaderLibrary(Path("nowhere"), {name.replace("__", "."): text for name, text in files.items()})


def test_a_file_is_included_once_even_in_circles() -> None:
    library = library_of(
        main__comp='#version 430\n#include "a.glsl"\n#include "b.glsl"\nvoid main() {}\n',
        a__glsl='#include "b.glsl"\nint a;\n',
        b__glsl='#include "a.glsl"\nint b;\n',
    )
    source = library.assemble("main.comp")
    assert source.text.count("int a;") == 1
    assert source.text.count("int b;") == 1
    assert source.files == ("main.comp", "a.glsl", "b.glsl")


def test_a_define_of_zero_is_defined(graphics: GraphicsContext) -> None:
    text = """#version 430
layout(local_size_x = 1) in;
#ifndef FLAG
#error FLAG is missing
#endif
#if FLAG
#error FLAG is not zero
#endif
layout(std430, binding = 0) buffer Out { float value[]; };
void main() { value[0] = float(FLAG) + SHARE; }
"""
    factory = ProgramFactory(graphics.gl, library_of(main__comp=text))
    program = factory.compute("main.comp", {"FLAG": 0, "SHARE": 0.25})
    assert factory.compute("main.comp", {"SHARE": 0.25, "FLAG": 0}) is program
    with pytest.raises(ShaderError, match="FLAG is not zero"):
        factory.compute("main.comp", {"FLAG": 1, "SHARE": 0.25})
    factory.release()


BROKEN = "// one\n// two\nint broken() { return undeclared_name; }\n"


HEAD = "#version 430\nlayout(local_size_x = 1) in;\n"


@pytest.mark.parametrize(
    ("body", "place"),
    [
        ('#include "ok.glsl"\n#include "broken.glsl"\nvoid main() {}\n', "broken.glsl:3"),
        ('#include "ok.glsl"\n\nvoid main() { undeclared_name = 1; }\n', "main.comp:5"),
        ("void main() { undeclared_name = 1; }\n", "main.comp:3"),
    ],
)
def test_errors_name_file_and_line(graphics: GraphicsContext, body: str, place: str) -> None:
    library = library_of(main__comp=HEAD + body, broken__glsl=BROKEN, ok__glsl="int fine() { return 1; }\n")
    with pytest.raises(ShaderError, match=re.escape(place)) as caught:
        ProgramFactory(graphics.gl, library).compute("main.comp", {"ONE": 1, "TWO": 2})
    assert "undeclared_name" in str(caught.value)


@pytest.mark.parametrize(("broken", "place"), [("vertex", "v.vert:2"), ("fragment", "f.frag:2")])
def test_errors_of_drawing_programs_name_the_right_stage(graphics: GraphicsContext, broken: str, place: str) -> None:
    bodies = dict.fromkeys(("vertex", "fragment"), "void main() {}") | {broken: "void main() { missing(); }"}
    library = library_of(v__vert=f"#version 430\n{bodies['vertex']}\n", f__frag=f"#version 430\n{bodies['fragment']}\n")
    with pytest.raises(ShaderError, match=re.escape(place)):
        ProgramFactory(graphics.gl, library).program("v.vert", "f.frag")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('#version 430\n#include "gone.glsl"\n', r"main.comp:2: gone.glsl: No such file"),
        ('#version 430\n#include "../../secret"\n', r"main.comp:2: .*outside the shader folder"),
        ("void main() {}\n", r"main.comp: has no #version"),
    ],
)
def test_what_cannot_be_assembled_says_why(text: str, message: str) -> None:
    with pytest.raises(ShaderError, match=message):
        library_of(main__comp=text).assemble("main.comp")


def test_unknown_uniforms_are_errors(graphics: GraphicsContext) -> None:
    text = """#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Out { float value[]; };
uniform float used;
uniform float removed;
uniform vec3 steps[2];
void main() { value[0] = used + steps[gl_LocalInvocationID.x].x + 0.0 * removed; }
"""
    factory = ProgramFactory(graphics.gl, library_of(main__comp=text))
    program = factory.compute("main.comp")
    output = graphics.memory.buffer("output", reserve=4)
    output.bind_to_storage_buffer(0)
    set_uniforms(program, {"used": 2.5, "removed": 1.0, "steps": np.array([0.5, 0, 0, 0, 0, 0], "<f4").tobytes()})
    program.run(1)
    graphics.gl.memory_barrier()
    assert np.frombuffer(output.read(), "<f4")[0] == 3.0
    for name in ("unused", "value", "steps[0]", ""):
        with pytest.raises(ShaderError, match=re.escape(f"no uniform {name!r}")):
            set_uniforms(program, {"used": 1.0, name: 1.0})
    output.release()
    factory.release()


def test_equal_generated_files_share_their_programs(graphics: GraphicsContext) -> None:
    text = (
        HEAD
        + '#include "value.glsl"\nlayout(std430, binding = 0) buffer Out { int value[]; };\nvoid main() { value[0] = VALUE; }\n'
    )
    factory = ProgramFactory(graphics.gl, library_of(main__comp=text))
    one, two = (factory.with_generated({"value.glsl": f"#define VALUE {number}\n"}) for number in (1, 2))
    assert factory.with_generated({"value.glsl": "#define VALUE 1\n"}) is one
    assert one.compute("main.comp") is not two.compute("main.comp")
    program = one.compute("main.comp")
    factory.release()
    assert isinstance(program.mglo, moderngl.InvalidObject)
