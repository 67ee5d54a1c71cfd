"""Syntax of the decoding shaders: expressions that know their types, statements, functions. All comments are kept."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal

SCALARS = ("float", "int", "uint", "bool")
_VECTORS = {"float": "vec", "int": "ivec", "uint": "uvec", "bool": "bvec"}


@dataclass(frozen=True)
class Type:
    """A type by its name in GLSL; an array of it where `count` is given."""

    name: str
    count: "Expression | None" = None

    @property
    def scalar(self) -> str:
        """Type of the components of a scalar or a vector; its own name otherwise."""
        for scalar, vector in _VECTORS.items():
            if self.name.startswith(vector) and self.name[len(vector) :].isdigit():
                return scalar
        return self.name

    @property
    def components(self) -> int:
        """2 to 4 for a vector, else 1."""
        return int(self.name[-1]) if self.name != self.scalar else 1

    @property
    def is_vector(self) -> bool:
        """True if it has components."""
        return self.name != self.scalar


def vector(scalar: str, components: int) -> Type:
    """Return the type of so many components."""
    return Type(scalar if components == 1 else f"{_VECTORS[scalar]}{components}")


VOID, INT, UINT, FLOAT, BOOL = (Type(name) for name in ("void", "int", "uint", "float", "bool"))


@dataclass(frozen=True)
class Number:
    """A number, or true or false."""

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
    """A call of a function of the source."""

    type: Type
    function: str
    arguments: "tuple[Expression, ...]"
    references: tuple[bool, ...]
    """True for each argument that the function writes into."""


@dataclass(frozen=True)
class Builtin:
    """A call of a function of GLSL. Arguments of `min`, `max`, `clamp` and `mix` have as many components as the result."""

    type: Type
    function: str
    arguments: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Construct:
    """A value made of parts, which have the type of its components; one part alone may also be spread or converted."""

    type: Type
    arguments: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Unary:
    """- ~ or ! of a value."""

    type: Type
    operator: str
    operand: "Expression"


@dataclass(frozen=True)
class Binary:
    """Two values and what stands between them."""

    type: Type
    operator: str
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True)
class Choice:
    """`condition ? chosen : other`."""

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
    """A variable, with its first value or none."""

    type: Type
    name: str
    value: Expression | None
    is_constant: bool
    comments: Comments = Comments()


@dataclass(frozen=True)
class Assign:
    """`target operator value`."""

    target: Expression
    operator: str
    value: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class If:
    """A branch; `otherwise` may be empty."""

    condition: Expression
    then: "tuple[Statement, ...]"
    otherwise: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class For:
    """A loop over a number that is declared by `first` and grows by `step`."""

    first: Declare
    condition: Expression
    step: Assign
    body: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class Repeat:
    """A loop that runs once and then again while `condition` holds."""

    body: "tuple[Statement, ...]"
    condition: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class Return:
    """The end of a function, with what it gives."""

    value: Expression
    comments: Comments = Comments()


@dataclass(frozen=True)
class Block:
    """Statements in braces."""

    body: "tuple[Statement, ...]"
    comments: Comments = Comments()


@dataclass(frozen=True)
class Run:
    """A call for what it writes into its arguments."""

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
        """True if the function writes into what is given."""
        return self.passing != "in"


@dataclass(frozen=True)
class Function:
    """A function of the source."""

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
    """Values that belong together."""

    name: str
    fields: tuple[Field, ...]
    comments: Comments = Comments()


Item = Declare | Function | Struct
"""Item outside functions: constant, function or struct."""


def walk(node: object) -> Iterator[Any]:
    """Yield `node` and all that it is made of."""
    if is_dataclass(node):
        yield node
        for own in fields(node):
            yield from walk(getattr(node, own.name))
    elif isinstance(node, tuple):
        for part in node:
            yield from walk(part)


def names_used(item: Item) -> set[str]:
    """Return the names of the constants, functions and types that `item` reads, and of its own variables."""
    found: set[str] = set()
    for node in walk(item):
        if isinstance(node, Name):
            found.add(node.name)
        elif isinstance(node, Call):
            found.add(node.function)
        elif isinstance(node, Type):
            found.add(node.name)
    return found


def renamed(node: Any, names: Mapping[str, str], own: frozenset[str] = frozenset()) -> Any:
    """Return `node` with functions, types and constants called as `names` says. Variables of a function, `own`, keep their names."""
    if isinstance(node, tuple):
        return tuple(renamed(part, names, own) for part in node)
    if not is_dataclass(node) or isinstance(node, type):
        return node
    if isinstance(node, Function):
        own = frozenset(part.name for part in walk(node) if isinstance(part, Parameter | Declare))
    changed = {part.name: renamed(getattr(node, part.name), names, own) for part in fields(node)}
    match node:
        case Type() | Function() | Struct():
            changed["name"] = names.get(node.name, node.name)
        case Name() | Declare() if node.name not in own:
            changed["name"] = names.get(node.name, node.name)
        case Call():
            changed["function"] = names.get(node.function, node.function)
        case _:
            pass
    return replace(node, **changed)
