"""Parser of GLSL without directives into `viewer.export.shader.syntax`. It knows only what the decoding shaders use of the language.

The decoders of all languages are translated from the viewer's shaders, so that there is one source. The steps are those of a compiler:

1. `source.decoding_source` resolves includes and conditions, and replaces buffers by functions that read words.
2. `parse` reads the text with tree-sitter, drops what the entry function does not reach, and gives each expression its type. Implicit
   conversions of GLSL become explicit (`typing_rules`), because WGSL has none.
3. `decoder.decoder_items` merges the planes: an item that is equal in all planes is written once.
4. A writer for each language (`c_like`, `cpp`, `hlsl`, `wgsl`) prints the items; it overrides only what differs from GLSL.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Final, Literal

import tree_sitter_glsl
from tree_sitter import Language, Node, Parser

from viewer.export.shader.syntax import (
    BOOL,
    FLOAT,
    INT,
    UINT,
    VOID,
    Assign,
    Block,
    Call,
    Comments,
    Construct,
    Declare,
    Expression,
    Field,
    For,
    Function,
    Group,
    If,
    Index,
    Item,
    Member,
    Name,
    Number,
    Parameter,
    Repeat,
    Return,
    Run,
    Statement,
    Struct,
    Type,
    Unary,
    vector,
)
from viewer.export.shader.typing_rules import (
    BUILTINS,
    TYPES,
    UnsupportedSourceError,
    binary,
    builtin,
    choice,
    construct,
    promoted,
)

_WIDE_PRODUCT: Final = "umulExtended"
PRODUCT_HIGH: Final = "product_high"
"""Function that each language supplies: the upper 32 bits of the product of two uint."""


def _text(node: Node | None) -> str:
    assert node is not None
    assert node.text is not None
    return node.text.decode()


def _child(node: Node, name: str) -> Node:
    child = node.child_by_field_name(name)
    if child is None:
        raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {_text(node)!r} has no {name}")
    return child


def _parts(node: Node) -> list[Node]:
    """Return the named children without comments."""
    return [child for child in node.named_children if child.type != "comment"]


class _Comments:
    """Comments among a list of siblings."""

    def __init__(self, siblings: Sequence[Node]) -> None:
        self._siblings = siblings

    def of(self, node: Node) -> Comments:
        """Return the comments directly above `node`, and the one behind it in its last line."""
        place = next(i for i, other in enumerate(self._siblings) if other.id == node.id)
        above: list[str] = []
        row, before = node.start_point[0], place - 1
        while before >= 0 and self._siblings[before].type == "comment":
            comment = self._siblings[before]
            is_alone = before == 0 or self._siblings[before - 1].end_point[0] < comment.start_point[0]
            if comment.end_point[0] != row - 1 or not is_alone:
                break
            above.insert(0, _comment(comment))
            row, before = comment.start_point[0], before - 1
        behind, end = "", node.end_point[0]
        for other in self._siblings[place + 1 :]:
            if other.start_point[0] != end:
                break
            if other.type == "comment":
                behind = _comment(other)
        blank = before >= 0 and self._siblings[before].end_point[0] < row - 1
        return Comments(tuple(above), behind, blank)


def _comment(node: Node) -> str:
    return _text(node).removeprefix("//").strip()


class _Reader:
    """Reader of items in order. It knows the names and types of earlier items."""

    def __init__(self, stored: Mapping[str, str], needed: AbstractSet[str]) -> None:
        self._stored, self._needed = stored, needed
        self._structs: dict[str, Struct] = {}
        self._functions: dict[str, Function] = {}
        self._names: dict[str, Type] = {}
        self._constants: set[str] = set()
        self._result = VOID

    def items(self, root: Node) -> Iterator[Item]:
        """Yield the constants, structs and functions that are needed."""
        comments = _Comments(root.children)
        for node in root.children:
            if node.type in ("comment", ";") or self._needed.isdisjoint(_names_of(node)):
                continue
            item_comments = comments.of(node)
            match node.type:
                case "struct_specifier":
                    struct = self._struct(node, item_comments)
                    self._structs[struct.name] = struct
                    yield struct
                case "function_definition" | "declaration" if _child(node, "declarator").type == "function_declarator":
                    function = self._function(node, item_comments)
                    known = self._functions.get(function.name)
                    if known is not None and known.body:
                        # Of overloads only the first is called here. `promoted` refuses a call of another one.
                        continue
                    self._functions[function.name] = function
                    if function.body:
                        yield function
                case "declaration":
                    yield from self._declare(node, item_comments)
                case _:
                    raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {node.type} {_text(node)[:60]!r}")

    def _type(self, node: Node, declarator: Node | None = None) -> Type:
        name = _text(node)
        if name not in TYPES and name not in self._structs:
            raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: type {name}")
        if declarator is not None and declarator.type == "array_declarator":
            return Type(name, self._expression(_child(declarator, "size")))
        return Type(name)

    def _struct(self, node: Node, comments: Comments) -> Struct:
        body = _child(node, "body")
        fields: list[Field] = []
        comments_of = _Comments(body.children)
        for child in body.children:
            if child.type == "field_declaration":
                declarator = _child(child, "declarator")
                name = _text(declarator if declarator.type != "array_declarator" else _child(declarator, "declarator"))
                if not name.startswith("padding"):
                    fields.append(Field(self._type(_child(child, "type"), declarator), name, comments_of.of(child)))
        return Struct(_text(_child(node, "name")), tuple(fields), comments)

    def _function(self, node: Node, comments: Comments) -> Function:
        declarator = _child(node, "declarator")
        parameters = []
        self._names = {name: kind for name, kind in self._names.items() if name in self._constants}
        for child in _parts(_child(declarator, "parameters")):
            parameter_declarator = _child(child, "declarator")
            kind = self._type(_child(child, "type"), parameter_declarator)
            name = _text(
                parameter_declarator
                if parameter_declarator.type != "array_declarator"
                else _child(parameter_declarator, "declarator")
            )
            words = [_text(part) for part in child.children]
            passing: Literal["in", "inout", "out"] = "inout" if "inout" in words else "out" if "out" in words else "in"
            parameters.append(Parameter(kind, name, passing))
            self._names[name] = kind
        self._result = self._type(_child(node, "type"))
        name = _text(_child(declarator, "declarator"))
        body = node.child_by_field_name("body")
        statements = self._block(body) if body is not None else ()
        return Function(self._result, name, tuple(parameters), statements, comments)

    def _declare(self, node: Node, comments: Comments) -> list[Declare]:
        """Return the variables of a declaration."""
        variables = list[Declare]()
        is_constant = any(child.type == "type_qualifier" and _text(child) == "const" for child in node.children)
        outside = node.parent is not None and node.parent.type == "translation_unit"
        for declarator in node.children_by_field_name("declarator"):
            value: Expression | None = None
            named = declarator
            if declarator.type == "init_declarator":
                named = _child(declarator, "declarator")
                value = self._expression(_child(declarator, "value"))
            kind = self._type(_child(node, "type"), named)
            name = _text(named if named.type != "array_declarator" else _child(named, "declarator"))
            self._names[name] = kind
            if outside:
                self._constants.add(name)
            if value is not None:
                value = promoted(value, kind.scalar)
            variables.append(Declare(kind, name, value, is_constant, comments if not variables else Comments()))
        return variables

    def _block(self, node: Node) -> tuple[Statement, ...]:
        """Return the statements in braces, or the single statement without braces."""
        if node.type != "compound_statement":
            return tuple(self._statement(node, Comments()))
        comments = _Comments(node.children)
        return tuple(
            statement
            for child in node.named_children
            if child.type != "comment"
            for statement in self._statement(child, comments.of(child))
        )

    def _statement(self, node: Node, comments: Comments) -> list[Statement]:
        match node.type:
            case "declaration":
                return list(self._declare(node, comments))
            case "compound_statement":
                return [Block(self._block(node), comments)]
            case "return_statement":
                if not _parts(node):
                    raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: return without a value")
                return [Return(promoted(self._expression(_parts(node)[0]), self._result.scalar), comments)]
            case "if_statement":
                otherwise = node.child_by_field_name("alternative")
                return [
                    If(
                        self._expression(_parts(_child(node, "condition"))[0]),
                        self._block(_child(node, "consequence")),
                        self._block(_parts(otherwise)[0]) if otherwise is not None else (),
                        comments,
                    )
                ]
            case "for_statement":
                first = self._declare(_child(node, "initializer"), Comments())[0]
                condition = self._expression(_child(node, "condition"))
                step = self._assignment(_child(node, "update"), Comments())[0]
                return [For(first, condition, step, self._block(_child(node, "body")), comments)]
            case "do_statement":
                condition = self._expression(_parts(_child(node, "condition"))[0])
                return [Repeat(self._block(_child(node, "body")), condition, comments)]
            case "expression_statement":
                return list(self._effect(_parts(node)[0], comments))
            case _:
                raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {node.type}")

    def _effect(self, node: Node, comments: Comments) -> list[Run] | list[Assign]:
        if node.type == "call_expression" and _text(_child(node, "function")) != _WIDE_PRODUCT:
            call = self._call(node)
            if isinstance(call, Call):
                return [Run(call, comments)]
        return self._assignment(node, comments)

    def _assignment(self, node: Node, comments: Comments) -> list[Assign]:
        if node.type == "update_expression":
            target = self._expression(_child(node, "argument"))
            return [Assign(target, f"{_text(_child(node, 'operator'))[0]}=", Number(INT, "1"), comments)]
        if node.type == "call_expression" and _text(_child(node, "function")) == _WIDE_PRODUCT:
            left, right, high, low = [self._expression(part) for part in _parts(_child(node, "arguments"))]
            if high in (left, right):
                raise UnsupportedSourceError(
                    f"line {node.start_point[0] + 1}: {_WIDE_PRODUCT} writes into what it reads"
                )
            upper = Call(UINT, PRODUCT_HIGH, (left, right), (False, False))
            return [Assign(high, "=", upper, comments), Assign(low, "=", binary("*", left, right))]
        if node.type != "assignment_expression":
            raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {_text(node)!r} changes nothing")
        target = self._expression(_child(node, "left"))
        operator = _text(_child(node, "operator"))
        value = self._expression(_child(node, "right"))
        if operator not in ("<<=", ">>="):
            value = promoted(value, target.type.scalar)
        return [Assign(target, operator, value, comments)]

    def _expression(self, node: Node) -> Expression:
        match node.type:
            case "number_literal":
                text = _text(node)
                is_hexadecimal = text[:2].lower() == "0x"
                is_float = "." in text or ("e" in text.lower() and not is_hexadecimal)
                return Number(FLOAT if is_float else UINT if text.endswith("u") else INT, text)
            case "true" | "false":
                return Number(BOOL, node.type)
            case "identifier":
                return self._name(node)
            case "parenthesized_expression":
                inner = self._expression(_parts(node)[0])
                return inner if isinstance(inner, Group | Name | Number | Construct) else Group(inner.type, inner)
            case "field_expression":
                return self._member(node)
            case "subscript_expression":
                return self._index(node)
            case "unary_expression":
                operand = self._expression(_child(node, "argument"))
                return Unary(operand.type, _text(_child(node, "operator")), operand)
            case "binary_expression":
                operator = _text(_child(node, "operator"))
                return binary(operator, self._expression(_child(node, "left")), self._expression(_child(node, "right")))
            case "conditional_expression":
                parts = [self._expression(_child(node, part)) for part in ("condition", "consequence", "alternative")]
                return choice(*parts)
            case "call_expression":
                return self._call(node)
            case _:
                raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {node.type} {_text(node)!r}")

    def _name(self, node: Node) -> Name:
        name = _text(node)
        if name not in self._names:
            raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {name} is not declared")
        return Name(self._names[name], name)

    def _member(self, node: Node) -> Member:
        base = self._expression(_child(node, "argument"))
        name = _text(_child(node, "field"))
        if base.type.name in self._structs:
            kind = next(field.type for field in self._structs[base.type.name].fields if field.name == name)
            return Member(kind, base, name)
        # GLSL names components by two sets of letters; the other languages get one.
        name = name.translate(str.maketrans("rgba", "xyzw"))
        return Member(vector(base.type.scalar, len(name)), base, name)

    def _index(self, node: Node) -> Expression:
        of, index = _child(node, "argument"), self._expression(_child(node, "index"))
        index = promoted(index, "int") if index.type != UINT else index
        if _text(of) in self._stored:
            function = self._functions[self._stored[_text(of)]]
            return Call(function.type, function.name, (index,), (False,))
        base = self._expression(of)
        kind = Type(base.type.name) if base.type.count is not None else Type(base.type.scalar)
        return Index(kind, base, index)

    def _call(self, node: Node) -> Expression:
        name = _text(_child(node, "function"))
        arguments = [self._expression(part) for part in _parts(_child(node, "arguments"))]
        if name in TYPES:
            return construct(TYPES[name], arguments)
        if name in self._structs:
            given = zip(arguments, self._structs[name].fields, strict=True)
            return Construct(Type(name), tuple(promoted(value, declared.type.scalar) for value, declared in given))
        if name in self._functions:
            function = self._functions[name]
            pairs = list(zip(arguments, function.parameters, strict=True))
            values = tuple(
                value if declared.is_reference else promoted(value, declared.type.scalar) for value, declared in pairs
            )
            return Call(function.type, name, values, tuple(declared.is_reference for _, declared in pairs))
        if name in BUILTINS:
            return builtin(name, arguments)
        raise UnsupportedSourceError(f"line {node.start_point[0] + 1}: {name} is not known")


def _names_in(node: Node) -> Iterator[str]:
    if node.type in ("identifier", "type_identifier"):
        yield _text(node)
    for child in node.children:
        yield from _names_in(child)


def _names_of(node: Node) -> list[str]:
    """Return the names that a node outside functions declares."""
    if node.type == "struct_specifier":
        return [_text(_child(node, "name"))]
    return [next(_names_in(declarator)) for declarator in node.children_by_field_name("declarator")]


def _needed(root: Node, stored: Mapping[str, str], entry: str) -> set[str]:
    """Return the names that `entry` reaches, itself included."""
    uses: dict[str, set[str]] = {}
    for node in root.children:
        for name in _names_of(node) if node.type not in ("comment", ";") else ():
            uses.setdefault(name, set()).update(stored.get(used, used) for used in _names_in(node))
    needed, open_names = set[str](), [entry]
    while open_names:
        name = open_names.pop()
        if name in uses and name not in needed:
            needed.add(name)
            open_names += uses[name]
    return needed


def parse(text: str, stored: Mapping[str, str], entry: str) -> tuple[Item, ...]:
    """Return the items that function `entry` of `text` reaches, `entry` last. Raises UnsupportedSourceError.

    `stored` maps arrays to functions: the element of such an array becomes a call of its function.
    """
    with warnings.catch_warnings():
        # The grammar passes its address as a number, which tree-sitter accepts with a warning.
        warnings.simplefilter("ignore", DeprecationWarning)
        language = Language(tree_sitter_glsl.language())
    tree = Parser(language).parse(text.encode())
    if tree.root_node.has_error:
        raise UnsupportedSourceError("the decoding shaders use GLSL that the parser does not know")
    needed = _needed(tree.root_node, stored, entry)
    return tuple(_Reader(stored, needed).items(tree.root_node))
