"""Unpacks the Mesa of another Debian suite into a folder, beside the system's: its llvmpipe, and zink with lavapipe.

`python3 -m tests.drivers.newer_mesa FOLDER [--suite SUITE]` needs apt and dpkg, no rights and no environment. Nothing of it is
installed: `tests/drivers/python.py` starts Python with the suite's own C library and dynamic linker.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PACKAGES = ("libegl1", "libgl1", "libegl-mesa0", "libgl1-mesa-dri", "libvulkan1", "mesa-vulkan-drivers")
"""With all that they depend on, down to the C library."""
SUITE = "trixie"
MIRROR = "http://deb.debian.org/debian"
KEYS = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
SECONDS = 300


def configured_mirror() -> str:
    """The mirror that this machine's apt takes Debian from, else MIRROR."""
    command = ["apt-get", "indextargets", "--format", "$(REPO_URI)", "Created-By: Packages", "Origin: Debian"]
    found = subprocess.run(command, capture_output=True, text=True, check=False).stdout.split()
    return next((uri for uri in found if not uri.rstrip("/").endswith("-security")), MIRROR)


def unpack(folder: Path, suite: str) -> None:
    """Make `folder`, which must not exist, with PACKAGES of `suite`; nothing is left where that fails.

    Raises CalledProcessError and TimeoutExpired.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as place:
        apt, made = Path(place) / "apt", Path(place) / "made"
        for part in ("etc/preferences.d", "etc/apt.conf.d", "lists/partial", "archives/partial", "root"):
            (apt / part).mkdir(parents=True)
        (apt / "status").touch()
        signed = f"[signed-by={KEYS}] " if KEYS.is_file() else ""
        (apt / "sources.list").write_text(f"deb {signed}{configured_mirror()} {suite} main\n", encoding="utf-8")
        options = {
            "Dir::Etc::SourceList": apt / "sources.list",
            "Dir::Etc::SourceParts": "/dev/null",
            "Dir::Etc::Preferences": "/dev/null",
            "Dir::Etc::PreferencesParts": apt / "etc/preferences.d",
            "Dir::State": apt,
            "Dir::State::Lists": apt / "lists",
            "Dir::State::Status": apt / "status",
            "Dir::Cache": apt,
            "Dir::Cache::Archives": apt / "archives",
            "APT::Sandbox::User": "",
            "APT::Install-Recommends": "false",
            "Acquire::Languages": "none",
            "Acquire::http::Timeout": "20",
            "Acquire::Retries": "1",
            "Debug::NoLocking": "true",
        }
        command = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in options.items())]
        for step in (["update", "-oAPT::Update::Error-Mode=any"], ["install", "--download-only", "-y", *PACKAGES]):
            subprocess.run([*command, *step], check=True, timeout=SECONDS, stdout=subprocess.DEVNULL)
        made.mkdir()
        for package in sorted((apt / "archives").glob("*.deb")):
            subprocess.run(["dpkg-deb", "--extract", package, made], check=True, timeout=SECONDS)
        made.rename(folder)


def main() -> None:
    """Unpack where nothing is yet; say in one line why not, and fail, where that cannot be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--suite", default=SUITE)
    given = parser.parse_args()
    if given.folder.exists():
        return
    if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
        sys.exit("newer Mesa: needs apt-get and dpkg-deb, which Debian and Ubuntu have")
    try:
        unpack(given.folder.resolve(), given.suite)
    except OSError as error:
        sys.exit(f"newer Mesa: {given.suite} cannot be unpacked: {error}")
    except subprocess.SubprocessError:
        sys.exit(f"newer Mesa: {given.suite} cannot be unpacked: apt-get or dpkg-deb failed, is there a network?")


if __name__ == "__main__":
    main()
