"""Sets of tests that `tests/run` leaves out unless what they guard has changed: other compilers, browsers, drivers, windows at rest.

`@pytest.mark.guards(SET)` puts a test into a set. Without the option `--changed`, pytest runs all of them.
`python -m tests.changes SET` has exit status 0 where the set has to run.
"""

import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
SETS: Final[dict[str, tuple[str, ...]]] = {
    "assets": ("assets/",),
    "blender": ("integrations/blender/", "viewer/export/gltf/", "tests/end_to_end/blender/"),
    "drawing": ("shaders/", "viewer/gl/", "viewer/render/", "tests/drivers/", "tests/gl/"),
    "exports": (
        "integrations/three/",
        "ntc/c/",
        "ntc/codec/",
        "ntc/pack/",
        "shaders/common/",
        "shaders/ntc/",
        "tests/end_to_end/export/",
        "viewer/export/",
    ),
    "lab": ("lab/", "ntc/"),
    "notebook": ("docs/guide/library.ipynb", "ntc/api.py", "ntc/__init__.py"),
    "rest": (
        "shaders/",
        "tests/support/rest/",
        "tests/ui/test_rest.py",
        "viewer/app/",
        "viewer/gl/",
        "viewer/render/",
        "viewer/state/",
    ),
    "training": ("ntc/codec/grid/", "ntc/training/", "ntc/worker/"),
}
"""What each set guards, as prefixes of paths in the repository."""
EVERYTHING: Final = ("pyproject.toml", "tests/changes.py", "tests/constraints.txt", "tests/run")
"""Paths that concern all sets."""
BASES: Final = ("upstream/main", "origin/main", "main")


def _git(*arguments: str) -> list[str] | None:
    """Return the lines that git prints, or None where it fails."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.splitlines() if done.returncode == 0 else None


@cache
def changed_paths() -> frozenset[str] | None:
    """Return the paths that differ from where this branch left the main one, new files included.

    None where there is nothing to compare with: on the main branch, in a shallow clone, without git.
    """
    head = _git("rev-parse", "HEAD")
    for name in BASES:
        base = _git("merge-base", "HEAD", name)
        if base and base != head:
            listed = (_git("diff", "--name-only", base[0]), _git("ls-files", "--others", "--exclude-standard"))
            return None if None in listed else frozenset(path for lines in listed for path in lines or ())
    return None


def has_to_run(name: str, changed: Iterable[str] | None) -> bool:
    """Return whether the set `name` guards any of the `changed` paths. Raises KeyError for an unknown set."""
    guarded = (*SETS[name], *EVERYTHING)
    return changed is None or any(path.startswith(guarded) for path in changed)


if __name__ == "__main__":
    sys.exit(not has_to_run(sys.argv[1], changed_paths()))
