"""The imports of the source have no cycles."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("ntc", "viewer", "lab")


def source_files(*folders: str) -> list[Path]:
    """Python files of `folders`, in order."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def test_no_module_imports_itself_by_way_of_others() -> None:
    modules = {module_name(path): path for path in source_files(*PACKAGES)}
    imports = {name: set(imported_modules(name, path, modules)) - {name} for name, path in modules.items()}
    assert any(imports.values())
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(reversed(error.args[1])))


def module_name(path: Path) -> str:
    """The dotted name of a module; of a package, that of its folder."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(name: str, path: Path, modules: dict[str, Path]) -> Iterator[str]:
    """Those of `modules` that the source of one names in an import, at its top or within, for types alone too.

    A name that is imported from a package counts as that package's, unless it is a module of its own.
    """
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        elif isinstance(node, ast.ImportFrom):
            package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
            start = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*start, *([node.module] if node.module else [])])
            for alias in node.names:
                found = f"{source}.{alias.name}"
                if found in modules or source in modules:
                    yield found if found in modules else source
