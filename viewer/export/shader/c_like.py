"""Writes `syntax` as source of languages that look like C. What differs from GLSL is for each language to say."""

from collections.abc import Iterable, Sequence

from viewer.export.shader.syntax import (
    Assign,
    Binary,
    Block,
    Builtin,
    Call,
    Choice,
    Comments,
    Construct,
    Declare,
    Expression,
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
)

INDENT = "    "


class CLikeWriter:
    """GLSL 4.30, as it was read."""

    def type_name(self, kind: Type) -> str:
        """Name of a type, the length of an array left out."""
        return kind.name

    def declared(self, kind: Type, name: str) -> str:
        """Type and name of a variable, a field or a parameter."""
        count = f"[{self.expression(kind.count)}]" if kind.count is not None else ""
        return f"{self.type_name(kind)} {name}{count}"

    def expression(self, value: Expression) -> str:
        """Source of a value."""
        match value:
            case Number():
                return self.number(value)
            case Name():
                return self.name(value)
            case Member():
                return self.member(value)
            case Index():
                return f"{self.expression(value.base)}[{self.expression(value.index)}]"
            case Call():
                return self.call(value)
            case Builtin():
                return self.builtin(value, [self.expression(argument) for argument in value.arguments])
            case Construct():
                return self.construct(value, [self.expression(argument) for argument in value.arguments])
            case Unary():
                return f"{value.operator}{self.expression(value.operand)}"
            case Binary():
                return self.binary(value)
            case Choice():
                return self.choice(value)
            case Group():
                return f"({self.expression(value.inner)})"

    def number(self, value: Number) -> str:
        """Return a number."""
        return value.text

    def name(self, value: Name) -> str:
        """Return a variable."""
        return value.name

    def member(self, value: Member) -> str:
        """Return a field, or components."""
        return f"{self.expression(value.base)}.{value.name}"

    def call(self, value: Call) -> str:
        """Return a call of a function of the source."""
        return f"{value.function}({', '.join(self.expression(argument) for argument in value.arguments)})"

    def builtin(self, value: Builtin, arguments: Sequence[str]) -> str:
        """Return a call of a function of GLSL."""
        return f"{value.function}({', '.join(arguments)})"

    def relation(self, value: Builtin, operator: str) -> str:
        """Two vectors compared by an operator, for languages where that gives a vector."""
        parts = [
            f"({self.expression(part)})" if isinstance(part, Binary) else self.expression(part)
            for part in value.arguments
        ]
        return f"({parts[0]} {operator} {parts[1]})"

    def construct(self, value: Construct, arguments: Sequence[str]) -> str:
        """Return a value made of parts."""
        return f"{self.type_name(value.type)}({', '.join(arguments)})"

    def binary(self, value: Binary) -> str:
        """Two values joined."""
        return f"{self.expression(value.left)} {value.operator} {self.expression(value.right)}"

    def choice(self, value: Choice) -> str:
        """Return a choice between two values."""
        parts = (self.expression(part) for part in (value.condition, value.chosen, value.other))
        return "{} ? {} : {}".format(*parts)

    def statement(self, statement: Statement) -> list[str]:
        """Lines of a statement, comments left out."""
        match statement:
            case Declare():
                return [f"{self.variable(statement)};"]
            case Assign():
                return [f"{self.assignment(statement)};"]
            case Run():
                return [f"{self.call(statement.call)};"]
            case Return():
                return [f"return {self.expression(statement.value)};"]
            case Block():
                return ["{", *self.body(statement.body), "}"]
            case If():
                lines = [f"if ({self.expression(statement.condition)}) {{", *self.body(statement.then)]
                if statement.otherwise:
                    lines += ["} else {", *self.body(statement.otherwise)]
                return [*lines, "}"]
            case For():
                condition = self.expression(statement.condition)
                head = f"for ({self.counter(statement.first)}; {condition}; {self.assignment(statement.step)}) {{"
                return [head, *self.body(statement.body), "}"]
            case Repeat():
                return self.repeat(self.body(statement.body), self.expression(statement.condition))

    def repeat(self, body: list[str], condition: str) -> list[str]:
        """Lines of a loop that runs `body` once, and then again while `condition` holds."""
        return ["do {", *body, f"}} while ({condition});"]

    def variable(self, declaration: Declare) -> str:
        """Return a variable of a function."""
        first = f" = {self.expression(declaration.value)}" if declaration.value is not None else ""
        prefix = "const " if declaration.is_constant else ""
        return f"{prefix}{self.declared(declaration.type, declaration.name)}{first}"

    def counter(self, declaration: Declare) -> str:
        """Return the variable of a loop."""
        return self.variable(declaration)

    def assignment(self, statement: Assign) -> str:
        """Return a change of a variable."""
        if statement.operator == "+=" and statement.value == Number(statement.target.type, "1"):
            return f"++{self.expression(statement.target)}"
        return f"{self.expression(statement.target)} {statement.operator} {self.expression(statement.value)}"

    def body(self, statements: Iterable[Statement]) -> list[str]:
        """Lines of what stands in braces."""
        lines: list[str] = []
        for statement in statements:
            own = with_comments(self.statement(statement), statement.comments)
            lines += [f"{INDENT}{line}" if line else "" for line in own]
        return lines

    def parameter(self, parameter: Parameter) -> str:
        """Return a parameter of a function."""
        prefix = f"{parameter.passing} " if parameter.is_reference else ""
        return f"{prefix}{self.declared(parameter.type, parameter.name)}"

    def heading(self, function: Function) -> str:
        """Return the first line of a function, without its brace."""
        parameters = ", ".join(self.parameter(parameter) for parameter in function.parameters)
        return f"{self.type_name(function.type)} {function.name}({parameters})"

    def function(self, function: Function) -> list[str]:
        """Lines of a function."""
        return [f"{self.heading(function)} {{", *self.body(function.body), "}"]

    def field(self, kind: Type, name: str) -> str:
        """Return a field of a struct."""
        return f"{self.declared(kind, name)};"

    def struct(self, struct: Struct) -> list[str]:
        """Lines of a struct."""
        lines = [f"struct {struct.name} {{"]
        for own in struct.fields:
            written = with_comments([self.field(own.type, own.name)], own.comments)
            lines += [f"{INDENT}{line}" for line in written]
        return [*lines, "};"]

    def constant(self, declaration: Declare) -> list[str]:
        """Lines of a constant outside functions."""
        return self.statement(declaration)

    def item(self, item: Item) -> list[str]:
        """Lines of what stands outside functions."""
        match item:
            case Declare():
                return self.constant(item)
            case Struct():
                return self.struct(item)
            case Function():
                return self.function(item)

    def items(self, items: Iterable[Item]) -> str:
        """Return all items, with their comments; a line is left free between those that take several."""
        lines: list[str] = []
        before: Item | None = None
        for item in items:
            own = with_comments(self.item(item), item.comments)
            if before is not None and not (isinstance(item, Declare) and isinstance(before, Declare)):
                lines.append("")
            lines += own
            before = item
        return "\n".join(lines) + "\n"


def with_comments(lines: list[str], comments: Comments) -> list[str]:
    """Return `lines` of source with what is said of them."""
    above = [f"// {comment}".rstrip() for comment in comments.above]
    if comments.behind:
        lines = [*lines[:-1], f"{lines[-1]}  // {comments.behind}"]
    return above + lines
