"""Writer of a syntax tree as GLSL, and base of the writers of other languages, which override what differs from GLSL."""

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
    """Writer of GLSL 4.30."""

    def type_name(self, kind: Type) -> str:
        """Return the name of a type, without the length of an array."""
        return kind.name

    def declared(self, kind: Type, name: str) -> str:
        """Return type and name of a variable, a field or a parameter."""
        count = f"[{self.expression(kind.count)}]" if kind.count is not None else ""
        return f"{self.type_name(kind)} {name}{count}"

    def expression(self, value: Expression) -> str:
        """Return the source of an expression."""
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
        """Return the comparison of two vectors by an operator, in languages where it gives a vector."""
        parts = [
            f"({self.expression(part)})" if isinstance(part, Binary) else self.expression(part)
            for part in value.arguments
        ]
        return f"({parts[0]} {operator} {parts[1]})"

    def construct(self, value: Construct, arguments: Sequence[str]) -> str:
        """Return a value made of parts."""
        return f"{self.type_name(value.type)}({', '.join(arguments)})"

    def binary(self, value: Binary) -> str:
        """Return a binary expression."""
        return f"{self.expression(value.left)} {value.operator} {self.expression(value.right)}"

    def choice(self, value: Choice) -> str:
        """Return a choice between two values."""
        parts = (self.expression(part) for part in (value.condition, value.chosen, value.other))
        return "{} ? {} : {}".format(*parts)

    def statement(self, statement: Statement) -> list[str]:
        """Return the lines of a statement, without comments."""
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
        """Return the lines of a loop that runs `body` once, and then again while `condition` holds."""
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
        """Return an assignment."""
        if statement.operator == "+=" and statement.value == Number(statement.target.type, "1"):
            return f"++{self.expression(statement.target)}"
        return f"{self.expression(statement.target)} {statement.operator} {self.expression(statement.value)}"

    def body(self, statements: Iterable[Statement]) -> list[str]:
        """Return the lines between braces."""
        lines: list[str] = []
        for statement in statements:
            lines_of_statement = with_comments(self.statement(statement), statement.comments)
            lines += [f"{INDENT}{line}" if line else "" for line in lines_of_statement]
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
        """Return the lines of a function."""
        return [f"{self.heading(function)} {{", *self.body(function.body), "}"]

    def field(self, kind: Type, name: str) -> str:
        """Return a field of a struct."""
        return f"{self.declared(kind, name)};"

    def struct(self, struct: Struct) -> list[str]:
        """Return the lines of a struct."""
        lines = [f"struct {struct.name} {{"]
        for struct_field in struct.fields:
            written = with_comments([self.field(struct_field.type, struct_field.name)], struct_field.comments)
            lines += [f"{INDENT}{line}" for line in written]
        return [*lines, "};"]

    def constant(self, declaration: Declare) -> list[str]:
        """Return the lines of a constant outside functions."""
        return self.statement(declaration)

    def item(self, item: Item) -> list[str]:
        """Return the lines of a constant, a struct or a function."""
        match item:
            case Declare():
                return self.constant(item)
            case Struct():
                return self.struct(item)
            case Function():
                return self.function(item)

    def items(self, items: Iterable[Item]) -> str:
        """Return the source of all items with their comments; an empty line separates items, except successive constants."""
        lines: list[str] = []
        before: Item | None = None
        for item in items:
            lines_of_item = with_comments(self.item(item), item.comments)
            if before is not None and not (isinstance(item, Declare) and isinstance(before, Declare)):
                lines.append("")
            lines += lines_of_item
            before = item
        return "\n".join(lines) + "\n"


def with_comments(lines: list[str], comments: Comments) -> list[str]:
    """Return `lines` of source with the comments above them and behind the last one."""
    above = [f"// {comment}".rstrip() for comment in comments.above]
    if comments.behind:
        lines = [*lines[:-1], f"{lines[-1]}  // {comments.behind}"]
    return above + lines
