"""Writer of C++ 17 for CPUs and of CUDA for NVIDIA's GPUs: both compile the same source."""

from collections.abc import Sequence
from typing import Final

from viewer.export.shader.c_like import INDENT, CLikeWriter
from viewer.export.shader.syntax import (
    Builtin,
    Construct,
    Declare,
    Function,
    Item,
    Member,
    Name,
    Number,
    Parameter,
    vector,
    walk,
)

# `min` and `max` are macros in the headers of Windows.
_FUNCTIONS: Final = {"roundEven": "round_even", "bitCount": "bit_count", "min": "smaller", "max": "larger"}
_BITS: Final = {"floatBitsToUint": "float_bits_to_uint", "uintBitsToFloat": "uint_bits_to_float"}


class CppWriter(CLikeWriter):
    """Writer of C++: items become members of a struct that holds the words of the pack's data."""

    def number(self, value: Number) -> str:
        """Return a number."""
        return f"{value.text}f" if value.type.name == "float" else value.text

    def member(self, value: Member) -> str:
        """Return a field, or components."""
        if len(value.name) == 1 or not value.base.type.is_vector:
            return super().member(value)
        base = self.expression(value.base)
        kind = self.type_name(vector(value.base.type.scalar, len(value.name)))
        if isinstance(value.base, Name):
            return f"{kind}({', '.join(f'{base}.{component}' for component in value.name)})"
        # A constructor of a shorter vector takes the first components.
        return f"{kind}{base}"

    def builtin(self, value: Builtin, arguments: Sequence[str]) -> str:
        """Return a call of a function."""
        name = "chosen" if value.function == "mix" and value.arguments[2].type.scalar == "bool" else value.function
        name = _BITS.get(name, _FUNCTIONS.get(name, name))
        return f"{name}({', '.join(arguments)})"

    def construct(self, value: Construct, arguments: Sequence[str]) -> str:
        """Return a value made of parts."""
        if not value.type.is_vector and len(arguments) > 1 and value.type.name != "mat4":
            return f"{value.type.name}{{{', '.join(arguments)}}}"
        return super().construct(value, arguments)

    def parameter(self, parameter: Parameter) -> str:
        """Return a parameter. Arrays are passed by address."""
        if parameter.type.count is not None:
            return f"{'' if parameter.is_reference else 'const '}{self.declared(parameter.type, parameter.name)}"
        if parameter.is_reference:
            return f"{self.type_name(parameter.type)}& {parameter.name}"
        return super().parameter(parameter)

    def heading(self, function: Function) -> str:
        """Return the first line of a function. Unused parameters have no name, because compilers warn about them otherwise."""
        read = {node.name for node in walk(function.body) if isinstance(node, Name)}
        parameters = [
            self.parameter(parameter)
            if parameter.name in read
            else f"{self.type_name(parameter.type)} /* {parameter.name} */"
            for parameter in function.parameters
        ]
        return f"NTC_FUNCTION {self.type_name(function.type)} {function.name}({', '.join(parameters)}) const"

    def constant(self, declaration: Declare) -> list[str]:
        """Return a constant."""
        return [f"static {line.replace('const', 'constexpr', 1)}" for line in super().constant(declaration)]

    def item(self, item: Item) -> list[str]:
        """Return the lines of a member of the struct."""
        return [f"{INDENT}{line}" if line else "" for line in super().item(item)]
