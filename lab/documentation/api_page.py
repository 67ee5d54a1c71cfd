"""Reference page of `import ntc`, made from its docstrings."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from typing import Any

import ntc


def _signature(name: str, function: Any) -> str:
    """Return the signature of a function; a long one has each parameter in a line."""
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
    """Return the parameters of a list; commas within brackets and quotes do not separate."""
    parts, depth, start = [], 0, 0
    for place, letter in enumerate(arguments):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append(arguments[start:place].strip())
            start = place + 1
    return [*parts, arguments[start:].strip()]


def class_fields(kind: type) -> Iterator[tuple[str, str, str]]:
    """Yield (name, type, docstring) of the fields of a dataclass in order."""
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
    """Yield the public properties and methods of a class in order."""
    for name, member in vars(kind).items():
        function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        if not name.startswith("_") and inspect.isfunction(function) and inspect.getdoc(function):
            yield name, member


def table_cell(text: str) -> str:
    """Return `text` with the bars escaped, for a cell of a Markdown table."""
    return text.replace("|", "\\|")


def _class_lines(name: str, kind: type) -> list[str]:
    lines = [f"### `{name}`", "", inspect.getdoc(kind) or "", ""]
    fields = list(class_fields(kind)) if not issubclass(kind, Exception) else []
    if fields:
        lines += ["| field | type | |", "|---|---|---|"]
        lines += [f"| `{field}` | `{table_cell(kind_of)}` | {table_cell(said)} |" for field, kind_of, said in fields]
        lines.append("")
    for member_name, member in _members(kind):
        function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        shown = f".{member_name}" if isinstance(member, property) else f".{member_name}()"
        said = (inspect.getdoc(function) or "").replace("\n", " ")
        lines.append(f"- `{shown}`: {said}")
    return [*lines, ""] if list(_members(kind)) else lines


def api_page() -> str:
    """Return the page as Markdown."""
    exported = {name: getattr(ntc, name) for name in ntc.__all__}
    functions = {name: value for name, value in exported.items() if inspect.isfunction(value)}
    errors = {
        name: value for name, value in exported.items() if inspect.isclass(value) and issubclass(value, Exception)
    }
    types = {name: value for name, value in exported.items() if name not in functions and name not in errors}
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
