"""What `import ntc` gives, from its docstrings."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from typing import Any

import ntc


def _signature(name: str, function: Any) -> str:
    """The function as it is written, each parameter in a line where it gets long."""
    parsed = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(parsed, ast.FunctionDef)
    result = f" -> {ast.unparse(parsed.returns).strip(chr(39))}" if parsed.returns is not None else ""
    arguments = ast.unparse(parsed.args)
    line = f"{name}({arguments}){result}"
    if len(line) <= 110:
        return line
    parts = _split(arguments)
    return f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){result}"


def _split(arguments: str) -> list[str]:
    """Parameters of a list; commas within brackets and quotes separate none."""
    parts, depth, start = [], 0, 0
    for place, letter in enumerate(arguments):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append(arguments[start:place].strip())
            start = place + 1
    return [*parts, arguments[start:].strip()]


def class_fields(kind: type) -> Iterator[tuple[str, str, str]]:
    """(name, type, what is said of it) of the fields of a dataclass, in their order."""
    parsed = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(parsed, ast.ClassDef)
    for place, node in enumerate(parsed.body):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            after = parsed.body[place + 1] if place + 1 < len(parsed.body) else None
            said = ""
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                said = inspect.cleandoc(str(after.value.value)).replace("\n", " ")
            default = f" = {ast.unparse(node.value)}" if node.value is not None else ""
            yield node.target.id, f"{ast.unparse(node.annotation)}{default}", said


def _members(kind: type) -> Iterator[tuple[str, Any]]:
    """Public properties and methods of a class, in their order."""
    for name, member in vars(kind).items():
        function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        if not name.startswith("_") and inspect.isfunction(function) and inspect.getdoc(function):
            yield name, member


def table_cell(text: str) -> str:
    return text.replace("|", "\\|")


def _class_lines(name: str, kind: type) -> list[str]:
    lines = [f"### `{name}`", "", inspect.getdoc(kind) or "", ""]
    fields = list(class_fields(kind)) if not issubclass(kind, Exception) else []
    if fields:
        lines += ["| field | type | |", "|---|---|---|"]
        lines += [f"| `{field}` | `{table_cell(kind_of)}` | {table_cell(said)} |" for field, kind_of, said in fields]
        lines.append("")
    for own, member in _members(kind):
        function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        shown = f".{own}" if isinstance(member, property) else f".{own}()"
        said = (inspect.getdoc(function) or "").replace("\n", " ")
        lines.append(f"- `{shown}`: {said}")
    return [*lines, ""] if list(_members(kind)) else lines


def api_page() -> str:
    """The page as Markdown."""
    exported = {name: getattr(ntc, name) for name in ntc.__all__}
    functions = {name: own for name, own in exported.items() if inspect.isfunction(own)}
    errors = {name: own for name, own in exported.items() if inspect.isclass(own) and issubclass(own, Exception)}
    types = {name: own for name, own in exported.items() if name not in functions and name not in errors}
    lines = ["## Functions", ""]
    for name, function in functions.items():
        lines += [
            f"### `{name}`",
            "",
            "```python",
            _signature(name, function),
            "```",
            "",
            inspect.getdoc(function) or "",
            "",
        ]
    lines += ["## Types", ""]
    for name, kind in types.items():
        lines += _class_lines(name, kind)
    lines += ["## Errors", ""]
    for name, kind in errors.items():
        lines += _class_lines(name, kind)
    return "\n".join(lines).rstrip("\n") + "\n"
