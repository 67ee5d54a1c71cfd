"""Types of GLSL expressions (GLSL 4.30, Sec. 4.1.10 and 8). Implicit conversions become explicit, because WGSL has none."""

from collections.abc import Sequence
from typing import Final

from viewer.export.shader.syntax import (
    BOOL,
    FLOAT,
    INT,
    SCALARS,
    UINT,
    Binary,
    Builtin,
    Choice,
    Construct,
    Expression,
    Group,
    Member,
    Name,
    Number,
    Type,
    Unary,
    vector,
)

_COMPARISONS: Final = ("<", "<=", ">", ">=", "==", "!=", "&&", "||")
_PROMOTIONS: Final = (("int", "uint"), ("int", "float"), ("uint", "float"))
_SAME: Final = ("abs", "exp2", "floor", "fract", "roundEven", "max", "min", "clamp", "mix", "sqrt")
_BY_COMPONENT: Final = ("max", "min", "clamp", "mix")
_RELATIONS: Final = ("equal", "notEqual", "greaterThan")
BUILTINS: Final = (*_SAME, *_RELATIONS, "any", "dot", "bitCount", "floatBitsToUint", "uintBitsToFloat")
TYPES: Final = {
    **{name: Type(name) for name in (*SCALARS, "void", "mat4")},
    **{vector(scalar, components).name: vector(scalar, components) for scalar in SCALARS for components in (2, 3, 4)},
}


class UnsupportedSourceError(Exception):
    """GLSL that cannot be translated to all languages; the message names it."""


def converted(value: Expression, scalar: str) -> Expression:
    """Return `value` with components of type `scalar`."""
    if value.type.scalar == scalar or value.type.scalar not in SCALARS:
        return value
    if isinstance(value, Number) and value.type == INT and scalar in ("uint", "float"):
        return Number(UINT if scalar == "uint" else FLOAT, f"{value.text}{'u' if scalar == 'uint' else '.0'}")
    return Construct(vector(scalar, value.type.components), (value,))


def promoted(value: Expression, scalar: str) -> Expression:
    """Return `value` with GLSL's implicit conversion to components of type `scalar`: int to uint, and both to float.

    Raises UnsupportedSourceError where GLSL has no such conversion: the call was meant for another overload.
    """
    present = value.type.scalar
    if present in SCALARS and present != scalar and (present, scalar) not in _PROMOTIONS:
        raise UnsupportedSourceError(f"a value of type {present} is given where {scalar} is needed")
    return converted(value, scalar)


def choice(condition: Expression, chosen: Expression, other: Expression) -> Choice:
    """Return `condition ? chosen : other` with both values in the wider type."""
    scalars = {chosen.type.scalar, other.type.scalar}
    if len(scalars) > 1:
        wider = "float" if "float" in scalars else "uint"
        chosen, other = promoted(chosen, wider), promoted(other, wider)
    return Choice(chosen.type, condition, chosen, other)


def spread(value: Expression, components: int) -> Expression:
    """Return `value` with `components` components: those of a vector, or a scalar repeated."""
    if components == 1 or value.type.is_vector:
        return value
    return Construct(vector(value.type.scalar, components), (value,))


def construct(kind: Type, arguments: Sequence[Expression]) -> Expression:
    """Return `kind(arguments)`. A single argument of that type stays as it is."""
    if len(arguments) == 1 and arguments[0].type == kind:
        # The parentheses stay, because operators around the value may bind closer.
        return Group(kind, arguments[0]) if isinstance(arguments[0], Binary | Choice | Unary) else arguments[0]
    if kind.name == "mat4" or (len(arguments) == 1 and arguments[0].type.components == kind.components > 1):
        return Construct(kind, tuple(arguments))
    if len(arguments) == 1 and arguments[0].type.components > kind.components:
        # GLSL drops the other components.
        whole = arguments[0] if isinstance(arguments[0], Name) else Group(arguments[0].type, arguments[0])
        first = vector(whole.type.scalar, kind.components)
        return construct(kind, [Member(first, whole, "xyzw"[: kind.components])])
    if len(arguments) == 1 and not kind.is_vector:
        return converted(arguments[0], kind.name)
    return Construct(kind, tuple(converted(argument, kind.scalar) for argument in arguments))


def binary(operator: str, left: Expression, right: Expression) -> Binary:
    """Return `left operator right` with its type and GLSL's conversions."""
    if operator in ("<<", ">>"):
        return Binary(left.type, operator, left, right)
    scalars = {left.type.scalar, right.type.scalar}
    for wider in ("float", "uint"):
        if wider in scalars and len(scalars) > 1 and left.type.name != "mat4":
            left, right = converted(left, wider), converted(right, wider)
            break
    if operator in _COMPARISONS:
        if left.type.is_vector or right.type.is_vector:
            raise UnsupportedSourceError(
                f"{operator}: between vectors it gives one value in some languages and several in others"
            )
        return Binary(BOOL, operator, left, right)
    if left.type.name == "mat4":
        return Binary(right.type, operator, left, right)
    return Binary(max(left.type, right.type, key=lambda kind: kind.components), operator, left, right)


def builtin(function: str, arguments: Sequence[Expression]) -> Builtin:
    """Return a call of a built-in function of GLSL, arguments converted. Raises UnsupportedSourceError."""
    if function not in BUILTINS:
        raise UnsupportedSourceError(f"{function}: not a function that all languages have")
    given = list(arguments)
    if function in _BY_COMPONENT:
        scalar = "float" if any(value.type.scalar == "float" for value in given) else given[0].type.scalar
        components = max(value.type.components for value in given)
        given = [
            value if value.type.scalar == "bool" else spread(converted(value, scalar), components) for value in given
        ]
    first = given[0].type
    kind = first
    if function in _RELATIONS:
        second = spread(given[1], first.components)
        given = [given[0], converted(second, first.scalar)]
        kind = vector("bool", first.components)
    elif function == "any":
        kind = BOOL
    elif function == "dot":
        kind = FLOAT
    elif function == "bitCount":
        kind = INT
    elif function == "floatBitsToUint":
        kind = vector("uint", first.components)
    elif function == "uintBitsToFloat":
        kind = vector("float", first.components)
    return Builtin(kind, function, tuple(given))
