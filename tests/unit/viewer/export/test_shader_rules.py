"""How decoding shaders are read to be written in other languages: what GLSL means is kept, what cannot be kept is refused."""

import pytest

from viewer.export.shader.c_like import CLikeWriter
from viewer.export.shader.parse import parse
from viewer.export.shader.typing_rules import UnsupportedSourceError


def written(parameters: str, body: str, result: str = "float") -> str:
    """A function of GLSL, read and written as GLSL again; its body in one line."""
    source = f"{result} decode({parameters}) {{\n    {body}\n}}\n"
    lines = CLikeWriter().items(parse(source, {}, "decode")).splitlines()
    return " ".join(line.strip() for line in lines[1:-1])


@pytest.mark.parametrize("kind", ["float", "vec2"])
def test_a_sum_that_has_the_type_already_stays_a_factor(kind: str) -> None:
    assert written(f"{kind} a, {kind} b", f"return {kind}(a + b) * 2.0;", kind) == "return (a + b) * 2.0;"


def test_both_sides_of_a_choice_get_the_wider_type() -> None:
    assert written("bool c, float x", "return c ? 1 : x;") == "return c ? 1.0 : x;"
    assert written("bool c, float x", "return c ? x : 1;") == "return c ? x : 1.0;"
    assert written("bool c, uint x", "return c ? 1 : x;", "uint") == "return c ? 1u : x;"


def test_a_loop_that_ends_at_its_end_stays_one() -> None:
    loop = "int n = 0; if (x > 0.0) do { x *= 0.5; ++n; } while (n < 3); return x;"
    written_loop = "do { x *= 0.5; ++n; } while (n < 3);"
    assert written("float x", loop) == f"int n = 0; if (x > 0.0) {{ {written_loop} }} return x;"


def test_numbers_with_an_exponent_are_floats() -> None:
    assert written("float x", "return x * 1e-3 + .5;") == "return x * 1e-3 + .5;"
    assert written("uint x", "return x & 0xE1u;", "uint") == "return x & 0xE1u;"


@pytest.mark.parametrize(
    ("parameters", "body", "result"),
    [
        ("float x", "return x;", "int"),
        ("vec2 a, vec2 b", "return a == b;", "bool"),
        ("uint a, uint b", "umulExtended(a, b, a, b); return a;", "uint"),
        ("float x", "return;", "void"),
    ],
)
def test_what_other_languages_take_otherwise_is_refused(parameters: str, body: str, result: str) -> None:
    with pytest.raises(UnsupportedSourceError):
        written(parameters, body, result)


def test_a_call_of_the_second_of_two_overloads_is_refused() -> None:
    overloads = "float f(int a) {\n    return 1.0;\n}\nfloat f(float a) {\n    return 2.0;\n}\n"
    with pytest.raises(UnsupportedSourceError, match="float is given where int"):
        parse(f"{overloads}float decode(float x) {{\n    return f(x);\n}}\n", {}, "decode")
