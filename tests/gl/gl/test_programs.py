"""Assembling and compiling GLSL: every shader, includes once, defines, errors with file and line."""

import re
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.gpu import DecodingBinding, DecodingImage, DecodingUniform
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
)

ALL_GLSL = sorted(
    path.relative_to(shaders_folder()).as_posix() for path in shaders_folder().rglob("*") if path.is_file()
)


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
