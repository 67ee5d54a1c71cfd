"""Builds libntc into the wheel where there is a C compiler; else, or with NTC_VIEWER_PURE set, the wheel is pure Python."""

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))
from ntc.c.library import SUFFIX, build


class LibntcHook(BuildHookInterface):
    def initialize(self, _version: str, build_data: dict[str, Any]) -> None:
        """Compile libntc, and say for which machines the wheel is."""
        if os.environ.get("NTC_VIEWER_PURE"):
            return
        if build() is None:
            self.app.display_warning("libntc was not built: ntc.decode takes numpy")
            return
        build_data["artifacts"].append(f"/ntc/c/libntc-*{SUFFIX}")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
