"""`python -m tests.support.compile_ahead`: compile what encoding runs, once, before several processes that find none each do."""

import tempfile
from pathlib import Path

from tests.support.rest.detailed_scenes import encode, write_wall


def main() -> None:
    """Encode a small scene: numba keeps what it compiles for the processes that follow."""
    with tempfile.TemporaryDirectory() as folder:
        encode(write_wall(Path(folder) / "wall.glb"), Path(folder) / "wall.ntc")


if __name__ == "__main__":
    main()
