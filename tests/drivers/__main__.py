"""`python -m tests.drivers [all] [PYTEST ARGUMENT ...]`: tests of what other drivers of OpenGL may do differently.

Runs the tests marked `driver`, or with `all` everything that draws, with every driver that there is besides the system's, and says
which those are. Pictures are compared with those of the system's driver, drawn in the same run. README.md beside says more.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from tests.drivers.drivers import ROOT, SYSTEM, Driver, other_drivers
from tests.drivers.messages import own_session_folders
from tests.drivers.pictures import ALL_VARIABLE
from tests.drivers.test_pictures import FOLDER_VARIABLE

SOME, ALL = "driver and not once", "not once"


def say(line: str) -> None:
    """Write a line before what processes write next."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def marked(folders: Sequence[str]) -> Iterator[str]:
    """Yield the files of `folders` with tests marked `driver`: no others are read."""
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("test_*.py")):
            if "mark.driver" in path.read_text(encoding="utf-8"):
                yield str(path.relative_to(ROOT))


def main() -> None:
    """Fails where any driver fails; drivers that are not there are named with what would make them usable."""
    say(f"driver: {SYSTEM.name}: {SYSTEM.description()}")
    everything, given = sys.argv[1:2] == ["all"], sys.argv[1:]
    options = ("-n", "2", "--dist", "loadscope", "-m", ALL, *given[1:]) if everything else ("-m", SOME, *given)
    usable = list[Driver]()
    for driver, text in other_drivers():
        say(f"no driver: {text}" if driver is None else f"driver: {driver.name}: {text}")
        usable += [] if driver is None else [driver]
    if not usable:
        return
    failed = list[str]()
    with tempfile.TemporaryDirectory() as pictures:
        variables = {FOLDER_VARIABLE: pictures, **({ALL_VARIABLE: "1"} if everything else {})}
        if SYSTEM.run("-m", "tests.drivers.pictures", pictures, variables=variables).returncode != 0:
            sys.exit("the system's driver draws no pictures to compare with")

        def tested(driver: Driver) -> subprocess.CompletedProcess[str]:
            tests = driver.tests if everything else tuple(marked(driver.tests))
            return driver.run("-m", "pytest", *tests, *options, quiet=not everything, variables=variables)

        # All tests of a driver occupy two cores; some occupy one, and two cores are busy to the end if all drivers begin at once.
        with ThreadPoolExecutor(1 if everything else len(usable)) as pool:
            for driver, done in zip(usable, pool.map(tested, usable), strict=True):
                say(f"tests with {driver.name}\n{done.stdout or ''}{done.stderr or ''}")
                failed += [driver.name] if done.returncode != 0 else []
    if failed:
        sys.exit(f"tests failed with {', '.join(failed)}")


if __name__ == "__main__":
    with own_session_folders():
        main()
