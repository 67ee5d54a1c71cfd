"""Syntax tree of the decoding shaders: typed expressions, statements, functions and structs, with their comments."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal

SCALARS = ("float", "int", "uint", "bool")
_VECTORS = {"float": "vec", "int": "ivec", "uint": "uvec", "bool": "bvec"}


@dataclass(frozen=True)
class Type:
    """Type by its name in GLSL; with `count`, an array of it."""

    name: str
    count: "Expression | None" = None

    @property
    def scalar(self) -> str:
        """Type of the components of a scalar or a vector; for other types, `name`."""
        for scalar, vector in _VECTORS.items():
            if self.name.startswith(vector) and self.name[len(vector) :].isdigit():
                return scalar
        return self.name

    @property
    def components(self) -> int:
        """Number of components: 2 to 4 for a vector, else 1."""
        return int(self.name[-1]) if self.name != self.scalar else 1

    @property
    def is_vector(self) -> bool:
        """True for a type with several components."""
        return self.name != self.scalar


def vector(scalar: str, components: int) -> Type:
    """Return the type of `components` components of type `scalar`."""
    return Type(scalar if components == 1 else f"{_VECTORS[scalar]}{components}")


VOID, INT, UINT, FLOAT, BOOL = (Type(name) for name in ("void", "int", "uint", "float", "bool"))


@dataclass(frozen=True)
class Number:
    """Literal: a number, true or false."""

    type: Type
    text: str


@dataclass(frozen=True)
class Name:
    """A variable, a parameter or a constant."""

    type: Type
    name: str


@dataclass(frozen=True)
class Member:
    """A field of a struct, or components of a vector."""

    type: Type
    base: "Expression"
    name: str


@dataclass(frozen=True)
class Index:
    """An element of an array, or a component of a vector."""

    type: Type
    base: "Expression"
    index: "Expression"


@dataclass(frozen=True)
class Call:
    """Call of a function of the source."""

    type: Type
    function: str
    arguments: "tuple[Expression, ...]"
    references: tuple[bool, ...]
    """True for each argument that the function writes into."""


@dataclass(frozen=True)
class Builtin:
    """Call of a built-in function of GLSL. Arguments of `min`, `max`, `clamp` and `mix` have as many components as the result."""

    type: Type
    function: str
    arguments: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Construct:
    """Constructor of a value from parts of the type of its components. A single part may also be repeated or converted."""

    type: Type
    arguments: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Unary:
    """Unary operator: -, ~ or ! of a value."""

    type: Type
    operator: str
    operand: "Expression"


@dataclass(frozen=True)
class Binary:
    """Binary operator between two values."""

    type: Type
    operator: str
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True)
class Choice:
    """Conditional expression, `condition ? chosen : other`."""

    type: Type
    condition: "Expression"
    chosen: "Expression"
    other: "Expression"


@dataclass(frozen=True)
class Group:
    """Expression in parentheses."""

    type: Type
    inner: "Expression"


Expression = Number | Name | Member | Index | Call | Builtin | Construct | Unary | Binary | Choice | Group


@dataclass(frozen=True)
class Comments:
    """Comments of a line: above it, and behind it."""

    above: tuple[str, ...] = ()
    behind: str = ""
    blank_before: bool = field(default=False, compare=False)


@dataclass(frozen=True)
class Declare:
    """Declaration of a variable, with or without its first value."""

    type: Type
    name: str
    value: Expression | None
    is_constant: bool
    comments: Comments = Comments()


@dataclass(frozen=True)
class Assign:
    """Assignment, `target operator value`."""

    target: Expression
    operator: str
    value: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class If:
    """Branch on a condition; `otherwise` may be empty."""

    condition: Expression
    then: "tuple[Statement, ...]"
    otherwise: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class For:
    """Loop over a number that `first` declares and `step` changes."""

    first: Declare
    condition: Expression
    step: Assign
    body: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class Repeat:
    """Loop that runs once, and then again while `condition` holds."""

    body: "tuple[Statement, ...]"
    condition: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class Return:
    """Return statement with its value."""

    value: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class Block:
    """Statements in braces."""

    body: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class Run:
    """Call as a statement: the function writes into its arguments."""

    call: Call
    comments: Comments = Comments()


Statement = Declare | Assign | If | For | Repeat | Return | Block | Run


@dataclass(frozen=True)
class Parameter:
    """Parameter of a function."""

    type: Type
    name: str
    passing: Literal["in", "inout", "out"]

    @property
    def is_reference(self) -> bool:
        """True where the function writes into the argument."""
        return self.passing != "in"


@dataclass(frozen=True)
class Function:
    """Function of the source."""

    type: Type
    name: str
    parameters: tuple[Parameter, ...]
    body: tuple[Statement, ...]
    comments: Comments = Comments()


@dataclass(frozen=True)
class Field:
    """Field of a struct."""

    type: Type
    name: str
    comments: Comments = Comments()


@dataclass(frozen=True)
class Struct:
    """Struct of the source."""

    name: str
    fields: tuple[Field, ...]
    comments: Comments = Comments()


Item = Declare | Function | Struct
"""Item outside functions: constant, function or struct."""


def walk(node: object) -> Iterator[Any]:
    """Yield `node` and all nodes below it."""
    if is_dataclass(node):
        yield node
        for part_field in fields(node):
            yield from walk(getattr(node, part_field.name))
    elif isinstance(node, tuple):
        for part in node:
            yield from walk(part)


def names_used(item: Item) -> set[str]:
    """Return the names of the constants, functions, types and variables that `item` reads."""
    names: set[str] = set()
    for node in walk(item):
        if isinstance(node, Name):
            names.add(node.name)
        elif isinstance(node, Call):
            names.add(node.function)
        elif isinstance(node, Type):
            names.add(node.name)
    return names


def renamed(node: Any, names: Mapping[str, str], local_names: frozenset[str] = frozenset()) -> Any:
    """Return `node` with its functions, types and constants renamed by `names`; `local_names` of a function stay as they are."""
    if isinstance(node, tuple):
        return tuple(renamed(part, names, local_names) for part in node)
    if not is_dataclass(node) or isinstance(node, type):
        return node
    if isinstance(node, Function):
        local_names = frozenset(part.name for part in walk(node) if isinstance(part, Parameter | Declare))
    changed = {part.name: renamed(getattr(node, part.name), names, local_names) for part in fields(node)}
    match node:
        case Type() | Function() | Struct():
            changed["name"] = names.get(node.name, node.name)
        case Name() | Declare() if node.name not in local_names:
            changed["name"] = names.get(node.name, node.name)
        case Call():
            changed["function"] = names.get(node.function, node.function)
        case _:
            pass
    return replace(node, **changed)
