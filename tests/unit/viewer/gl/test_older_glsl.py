"""GLSL 4.30 said in GLSL 4.10: the same lines, buffers through texture buffers, bindings beside."""

import pytest

from viewer.gl.older_glsl import IMAGE_UNITS, STORAGE_UNITS, UnsuitableShaderError, older_source

RECORDS = """#version 430
#define BINDING_THINGS 3
struct Part {
    int a;
    vec4 b[2];
};
struct Thing {
    float c;
    uint d;
    Part parts[2];
};
layout(std430, binding = BINDING_THINGS) readonly buffer Things {
    Thing things[];
};
float first(int i) {
    return things[things[i].parts[1].a].parts[0].b[1].x;
}
"""


def test_an_element_is_read_by_a_function_and_its_words_lie_as_std430_has_them() -> None:
    found = older_source(RECORDS)
    assert found.units == {"things_words": STORAGE_UNITS + 3}
    # Part: 4 words to the first vector, 8 of vectors; Thing: 4 to the first part, two parts.
    assert "int at = index * 28;" in found.text
    assert "texelFetch(things_words, at + 16).x" in found.text
    assert "things_at(things_at(i).parts[1].a).parts[0].b[1].x" in found.text
    assert "430" not in found.text


def test_lines_stay_where_they_are() -> None:
    found = older_source(RECORDS)
    lines, older = RECORDS.splitlines(), found.text.splitlines()
    assert len(lines) == len(older)
    assert older[lines.index("float first(int i) {")] == "float first(int i) {"


def test_bindings_of_samplers_images_and_blocks_are_told_beside_the_text() -> None:
    found = older_source(
        "#version 430\n#define IMAGE_W 2\nlayout(binding = 4) uniform sampler2D picture;\n"
        "layout(rgba32f, binding = IMAGE_W) uniform readonly image2D weights;\n"
        "layout(std140, binding = 1) uniform Lights {\n    vec4 light;\n};\n"
        "vec4 weight(int k) {\n    return imageLoad(weights, ivec2(k & 3, k >> 2));\n}\n"
    )
    assert found.units == {"picture": 4, "weights": IMAGE_UNITS + 2}
    assert found.blocks == {"Lights": 1}
    assert "binding" not in found.text
    assert "texelFetch(weights, ivec2(k & 3, k >> 2), 0);" in found.text


def test_macros_of_several_lines_become_one_and_missing_functions_are_written_out() -> None:
    found = older_source(
        "#version 430\n#line 2 0\n#define ADD(a, b) \\\n    a + \\\n    b\nuint x = packSnorm2x16(vec2(1.0));\n"
    )
    assert "#define ADD(a, b)      a +      b\n\n\n" in found.text
    assert "uint packSnorm2x16(vec2 v)" in found.text.partition("#line 2 0")[0]


def test_a_buffer_of_what_cannot_be_read_is_one_line() -> None:
    text = "#version 430\nlayout(std430, binding = 0) readonly buffer B {\n    mat4 all[];\n};\n"
    with pytest.raises(UnsuitableShaderError, match="buffers of mat4 cannot be read"):
        older_source(text)
