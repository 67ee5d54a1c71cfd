"""Limits that the source keeps: sizes of files and folders, and imports without cycles."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("ntc", "viewer", "lab")
SOURCES = (*PACKAGES, "tests")
FEWEST_LINES, MOST_LINES, MOST_FILES = 30, 400, 20
SHORT_BY_NATURE = ("__init__.py", "__main__.py", "conftest.py")
NOT_SOURCES = ("__pycache__", "llvmpipe", "failed")
"""Folders of pictures and of what Python writes."""


def source_files(*folders: str) -> list[Path]:
    """Python files of `folders`, in order."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def test_no_file_is_a_fragment_or_too_long_to_read() -> None:
    lines = {path.relative_to(ROOT): len(path.read_text().splitlines()) for path in source_files(*SOURCES)}
    fragments = [f"{path}: {n}" for path, n in lines.items() if n < FEWEST_LINES and path.name not in SHORT_BY_NATURE]
    too_long = [f"{path}: {n}" for path, n in lines.items() if n > MOST_LINES]
    assert (fragments, too_long) == ([], [])


def test_no_folder_holds_too_many_files() -> None:
    folders = {path.parent for path in source_files(*SOURCES)} | {
        path.parent for path in (ROOT / "shaders").rglob("*.glsl")
    }
    counts = {folder.relative_to(ROOT): sum(path.is_file() for path in folder.iterdir()) for folder in folders}
    assert {str(folder): count for folder, count in counts.items() if count > MOST_FILES} == {}


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
