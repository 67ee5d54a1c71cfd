"""Writer of WGSL (W3C), without extensions.

WGSL differs from GLSL in three ways that change more than spelling: parameters cannot be written, so that written ones are copied to
variables; arguments that a function writes are pointers; operators on bits take other operators only in parentheses.
"""

from collections.abc import Sequence
from typing import Final

from viewer.export.shader.c_like import INDENT, CLikeWriter
from viewer.export.shader.syntax import (
    Assign,
    Binary,
    Builtin,
    Call,
    Choice,
    Construct,
    Declare,
    Expression,
    For,
    Function,
    Group,
    Index,
    Member,
    Name,
    Number,
    Parameter,
    Type,
    vector,
    walk,
)

_SCALARS: Final = {"float": "f32", "int": "i32", "uint": "u32", "bool": "bool"}
_FUNCTIONS: Final = {"roundEven": "round"}
_RELATIONS: Final = {"equal": "==", "notEqual": "!=", "greaterThan": ">"}
_BITWISE: Final = ("<<", ">>", "&", "|", "^")
SUPPORT: Final = f"""// The upper 32 bits of a product.
fn ntc_product_high(a: u32, b: u32) -> u32 {{
{INDENT}let low = (a & 0xFFFFu) * (b & 0xFFFFu);
{INDENT}let middle = (a >> 16u) * (b & 0xFFFFu) + (low >> 16u);
{INDENT}let other = (a & 0xFFFFu) * (b >> 16u) + (middle & 0xFFFFu);
{INDENT}return (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);
}}
"""


def _root(target: Expression) -> str:
    """Return the variable of which `target` is a part."""
    while isinstance(target, Member | Index | Group):
        target = target.inner if isinstance(target, Group) else target.base
    assert isinstance(target, Name)
    return target.name


def _changed(function: Function) -> set[str]:
    """Return the variables that the function changes after their declaration."""
    changed = set()
    for node in walk(function.body):
        if isinstance(node, Assign):
            changed.add(_root(node.target))
        elif isinstance(node, Call):
            pairs = zip(node.arguments, node.references, strict=True)
            changed |= {_root(argument) for argument, is_reference in pairs if is_reference}
    return changed


class WgslWriter(CLikeWriter):
    """Writer of WGSL."""

    def __init__(self) -> None:
        self._changed: set[str] = set()
        self._pointers: set[str] = set()

    def type_name(self, kind: Type) -> str:
        """Return the name of a type, with the length of an array."""
        if kind.name == "mat4":
            return "mat4x4<f32>"
        scalar = _SCALARS.get(kind.scalar, kind.name)
        name = f"vec{kind.components}<{scalar}>" if kind.is_vector else scalar
        return f"array<{name}, {self.expression(kind.count)}>" if kind.count is not None else name

    def declared(self, kind: Type, name: str) -> str:
        """Return name and type of a variable, a field or a parameter."""
        return f"{name}: {self.type_name(kind)}"

    def field(self, kind: Type, name: str) -> str:
        """Return a field of a struct."""
        return f"{self.declared(kind, name)},"

    def name(self, value: Name) -> str:
        """Return a variable."""
        return f"(*{value.name})" if value.name in self._pointers else value.name

    def call(self, value: Call) -> str:
        """Return a call of a function of the source."""
        given = []
        for argument, is_reference in zip(value.arguments, value.references, strict=True):
            if is_reference and isinstance(argument, Name) and argument.name in self._pointers:
                given.append(argument.name)
            else:
                given.append(f"&{self.expression(argument)}" if is_reference else self.expression(argument))
        return f"{value.function}({', '.join(given)})"

    def builtin(self, value: Builtin, arguments: Sequence[str]) -> str:
        """Return a call of a function."""
        if value.function in _RELATIONS:
            return self.relation(value, _RELATIONS[value.function])
        if value.function == "mix" and value.arguments[2].type.scalar == "bool":
            return f"select({', '.join(arguments)})"
        if value.function == "bitCount":
            return f"i32(countOneBits({arguments[0]}))"
        if value.function in ("floatBitsToUint", "uintBitsToFloat"):
            return f"bitcast<{self.type_name(value.type)}>({arguments[0]})"
        if value.function == "mix" and not value.arguments[2].type.is_vector and value.type.is_vector:
            return f"mix({', '.join(arguments)})"
        return f"{_FUNCTIONS.get(value.function, value.function)}({', '.join(arguments)})"

    def binary(self, value: Binary) -> str:
        """Return a binary expression. Operators on bits need parentheses around others, and shifts need unsigned numbers."""
        left, right = self.expression(value.left), self.expression(value.right)
        components = value.left.type.components
        if value.operator in ("<<", ">>") and value.right.type.scalar != "uint":
            unsigned = Number(vector("uint", 1), f"{value.right.text}u") if isinstance(value.right, Number) else None
            right = unsigned.text if unsigned is not None else f"u32({right})"
        if value.operator in _BITWISE and components > value.right.type.components:
            return f"{self.bracketed(value.left)} {value.operator} vec{components}<u32>({right})"
        if value.operator in _BITWISE:
            left = self.bracketed(value.left)
            right = f"({right})" if isinstance(value.right, Binary) and not right.startswith("u32(") else right
        else:
            left = self._apart(value.left, left)
            right = self._apart(value.right, right)
        return f"{left} {value.operator} {right}"

    def bracketed(self, part: Expression) -> str:
        """Return an operand of an operator on bits, in parentheses where it is a binary expression."""
        text = self.expression(part)
        return f"({text})" if isinstance(part, Binary) else text

    @staticmethod
    def _apart(part: Expression, text: str) -> str:
        return f"({text})" if isinstance(part, Binary) and part.operator in _BITWISE else text

    def choice(self, value: Choice) -> str:
        """Return `select`, which computes both values."""
        parts = (self.expression(part) for part in (value.other, value.chosen, value.condition))
        return f"select({', '.join(parts)})"

    def construct(self, value: Construct, arguments: Sequence[str]) -> str:
        """Return a value made of parts."""
        return f"{self.type_name(value.type)}({', '.join(arguments)})"

    def variable(self, declaration: Declare) -> str:
        """Return the declaration of a variable: `var` where it changes, `let` elsewhere."""
        if declaration.value is None:
            return f"var {self.declared(declaration.type, declaration.name)}"
        kind = "var" if declaration.name in self._changed else "let"
        return f"{kind} {self.declared(declaration.type, declaration.name)} = {self.expression(declaration.value)}"

    def repeat(self, body: list[str], condition: str) -> list[str]:
        """Return the lines of a loop that runs `body` once, and then again while `condition` holds."""
        return ["loop {", *body, f"{INDENT}if (!({condition})) {{", f"{INDENT * 2}break;", f"{INDENT}}}", "}"]

    def counter(self, declaration: Declare) -> str:
        """Return the variable of a loop."""
        assert declaration.value is not None
        return f"var {self.declared(declaration.type, declaration.name)} = {self.expression(declaration.value)}"

    def assignment(self, statement: Assign) -> str:
        """Return a change of a variable."""
        written = super().assignment(statement)
        return f"{written[2:]}++" if written.startswith("++") else written

    def constant(self, declaration: Declare) -> list[str]:
        """Return a constant."""
        assert declaration.value is not None
        return [f"const {self.declared(declaration.type, declaration.name)} = {self.expression(declaration.value)};"]

    def parameter(self, parameter: Parameter) -> str:
        """Return a parameter: a pointer where the function writes into it, elsewhere a value that it cannot change."""
        if parameter.is_reference:
            return f"{parameter.name}: ptr<function, {self.type_name(parameter.type)}>"
        name = f"given_{parameter.name}" if parameter.name in self._changed else parameter.name
        return self.declared(parameter.type, name)

    def heading(self, function: Function) -> str:
        """Return the first line of a function."""
        parameters = ", ".join(self.parameter(parameter) for parameter in function.parameters)
        result = f" -> {self.type_name(function.type)}" if function.type.name != "void" else ""
        return f"fn {function.name}({parameters}){result}"

    def function(self, function: Function) -> list[str]:
        """Return the lines of a function."""
        loops = {node.first.name for node in walk(function.body) if isinstance(node, For)}
        self._changed = _changed(function) - loops
        self._pointers = {parameter.name for parameter in function.parameters if parameter.is_reference}
        copies = [
            f"{INDENT}var {parameter.name} = given_{parameter.name};"
            for parameter in function.parameters
            if not parameter.is_reference and parameter.name in self._changed
        ]
        lines = [f"{self.heading(function)} {{", *copies, *self.body(function.body), "}"]
        self._pointers = set()
        return lines
