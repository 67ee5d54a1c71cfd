"""README, CONTRIBUTING and docs: generated parts are those of the code; links, anchors and paths lead somewhere."""

import re
from pathlib import Path

import pytest

import ntc
from lab.commands import STUDIES
from lab.documentation.__main__ import ROOT, generated, pages

PAGES = sorted({*pages(), *ROOT.glob("*.md"), *ROOT.glob("docs/**/*.ipynb")})
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`|^(?: {4}|\t).*?$", re.DOTALL | re.MULTILINE)
SOURCES = ("ntc", "viewer", "lab", "shaders", "tests", "assets")
PATH_OF_A_PAGE = re.compile(r"\bdocs/[\w/-]+\.(?:md|ipynb|png|webp|script)\b")
PATH_OF_A_SOURCE = re.compile(r"`((?:ntc|viewer|lab|shaders|tests|assets|integrations)/[a-z0-9_./]+)`")
EXAMPLE = "viewer/render/passes/posterize.py"
"""The pass that CONTRIBUTING shows how to add."""
GONE = "at commit "
"""Beside a command that was run once, and is no longer in the program."""
LONGEST_README_LINE, MOST_README_WORDS = 120, 800


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as the site and GitHub make them; a second one of a text gets a number."""
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.M), re.M):
        words = re.sub(r"[^\w\s-]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)).strip().lower()
        found.add(re.sub(r"[-\s]+", "-", words))
    return found


@pytest.mark.parametrize("page", list(pages()), ids=named)
def test_generated_parts_are_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert generated(text) == text, "run: python -m lab.documentation"


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page: Path) -> None:
    lost = []
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            lost.append(link)
    assert lost == []


def test_pages_that_sources_name_are_there() -> None:
    files = [
        file for folder in SOURCES for file in (ROOT / folder).rglob("*") if file.suffix in {".py", ".md", ".glsl"}
    ]
    files += [ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
    lost = {
        f"{named(file)}: {page}"
        for file in files
        for page in PATH_OF_A_PAGE.findall(file.read_text(encoding="utf-8"))
        if not (ROOT / page).exists()
    }
    assert lost == set()


@pytest.mark.parametrize("page", [ROOT / "CONTRIBUTING.md", ROOT / "docs/explanation/architecture.md"], ids=named)
def test_sources_that_pages_for_contributors_name_are_there(page: Path) -> None:
    paths = set(PATH_OF_A_SOURCE.findall(page.read_text(encoding="utf-8"))) - {EXAMPLE}
    built = {"ntc/decode.glsl"}  # an include, relative to shaders/
    assert [path for path in sorted(paths - built) if not (ROOT / path).exists()] == []
    assert paths != set()


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_modules_that_pages_run_are_there(page: Path) -> None:
    """Those that a page says are at an earlier commit are not, so that none is marked by mistake."""
    lines = page.read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    run = {
        (module, GONE in line)
        for line in lines
        for module in re.findall(r"python -m ((?:lab|tests|assets)[\w.]*)", line)
    }
    assert {(module, is_gone) for module, is_gone in run if _is_program(module) == is_gone} == set()


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_studies_that_pages_run_are_there(page: Path) -> None:
    names = {study.name for study in STUDIES}
    lines = page.read_text(encoding="utf-8").splitlines()
    run = {(name, GONE in line) for line in lines for name in re.findall(r"^ +ntc-viewer study ([a-z-]+)", line)}
    assert {(name, is_gone) for name, is_gone in run if (name in names) == is_gone} == set()


def _is_program(module: str) -> bool:
    path = ROOT / module.replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()


def test_the_site_shows_every_page() -> None:
    listed = re.findall(r"^ +- (?:[^:\n]+: )?([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.M)
    assert sorted(listed) == sorted(str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md"))


def test_the_readme_is_one_page() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) <= MOST_README_WORDS
    assert [line for line in text.splitlines() if len(line) > LONGEST_README_LINE] == []


def test_the_api_page_has_every_name() -> None:
    page = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
    assert [name for name in ntc.__all__ if f"### `{name}`\n" not in page] == []
