"""Writer of HLSL, shader model 5 and later, for the compilers FXC, DXC and glslang."""

from collections.abc import Sequence
from typing import Final

from viewer.export.shader.c_like import INDENT, CLikeWriter
from viewer.export.shader.syntax import Binary, Builtin, Construct, Declare, Struct, Type

_FUNCTIONS: Final = {
    "roundEven": "round",
    "fract": "frac",
    "mix": "lerp",
    "bitCount": "(int)countbits",
    "floatBitsToUint": "asuint",
    "uintBitsToFloat": "asfloat",
}
_RELATIONS: Final = {"equal": "==", "notEqual": "!=", "greaterThan": ">"}
CHOSEN: Final = "ntc_chosen"
"""Function that takes components of its second argument where the third is true; `select` exists in newer compilers only."""
SUPPORT: Final = "\n".join(
    [
        "// Components of `second` where `choice` is true, of `first` elsewhere.",
        *(
            f"float{n} {CHOSEN}(float{n} first, float{n} second, bool{n} choice) {{\n{INDENT}return float{n}("
            + ", ".join(f"choice.{c} ? second.{c} : first.{c}" for c in "xyzw"[:n])
            + ");\n}"
            for n in (2, 4)
        ),
        "",
        "// The upper 32 bits of a product.",
        "uint ntc_product_high(uint a, uint b) {",
        f"{INDENT}uint low = (a & 0xFFFFu) * (b & 0xFFFFu);",
        f"{INDENT}uint middle = (a >> 16u) * (b & 0xFFFFu) + (low >> 16u);",
        f"{INDENT}uint other = (a & 0xFFFFu) * (b >> 16u) + (middle & 0xFFFFu);",
        f"{INDENT}return (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);",
        "}",
        "",
    ]
)


class HlslWriter(CLikeWriter):
    """Writer of HLSL."""

    def __init__(self) -> None:
        self._structs: set[str] = set()

    def type_name(self, kind: Type) -> str:
        """Return the name of a type."""
        if kind.name == "mat4":
            # Rows of HLSL take the place of GLSL's columns. Therefore vectors are multiplied from the left.
            return "float4x4"
        return f"{kind.scalar}{kind.components}" if kind.is_vector else kind.name

    def builtin(self, value: Builtin, arguments: Sequence[str]) -> str:
        """Return a call of a function."""
        if value.function in _RELATIONS:
            return self.relation(value, _RELATIONS[value.function])
        if value.function == "mix" and value.arguments[2].type.scalar == "bool":
            return f"{CHOSEN}({', '.join(arguments)})"
        return f"{_FUNCTIONS.get(value.function, value.function)}({', '.join(arguments)})"

    def construct(self, value: Construct, arguments: Sequence[str]) -> str:
        """Return a value made of parts."""
        name = self.type_name(value.type)
        if value.type.name in self._structs:
            return f"new_{name}({', '.join(arguments)})"
        if len(arguments) == 1 and value.type.is_vector:
            return f"(({name})({arguments[0]}))"
        return f"{name}({', '.join(arguments)})"

    def binary(self, value: Binary) -> str:
        """Return a binary expression."""
        if value.left.type.name == "mat4":
            return f"mul({self.expression(value.right)}, {self.expression(value.left)})"
        return super().binary(value)

    def constant(self, declaration: Declare) -> list[str]:
        """Return a constant."""
        return [f"static {line}" for line in super().constant(declaration)]

    def struct(self, struct: Struct) -> list[str]:
        """Return a struct and, unless it has arrays, a function that makes one from all its fields."""
        self._structs.add(struct.name)
        lines = super().struct(struct)
        if any(struct_field.type.count is not None for struct_field in struct.fields):
            return lines
        parameters = ", ".join(self.declared(struct_field.type, struct_field.name) for struct_field in struct.fields)
        return [
            *lines,
            f"{struct.name} new_{struct.name}({parameters}) {{",
            f"{INDENT}{struct.name} made;",
            *(f"{INDENT}made.{struct_field.name} = {struct_field.name};" for struct_field in struct.fields),
            f"{INDENT}return made;",
            "}",
        ]
