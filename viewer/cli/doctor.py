"""`ntc-viewer doctor`: checks of OpenGL, display and packages on this machine."""

import importlib.metadata
import importlib.util
import json
import os
import platform
import sys
from typing import Any

from ntc.errors import InputError
from viewer.cli.options import DoctorOptions
from viewer.gl.context import create_headless_context
from viewer.gl.devices import find_devices
from viewer.gl.systems import SYSTEM
from viewer.render.path_choice import drawable_paths
from viewer.render.resources.decoding_shaders import variant_name

PACKAGES = (
    "moderngl",
    "moderngl-window",
    "glfw",
    "imgui-bundle",
    "numpy",
    "torch",
    "OpenImageIO",
    "trimesh",
    "safetensors",
    "DracoPy",
    "meshopt",
    "opengl-basisu",
)
OPTIONAL_MODULES = {"etcpak": "comparison with formats of graphics hardware: pip install 'ntc-viewer[lab]'"}


def has_display() -> bool:
    """Return whether a window can open: on Linux if a display server is named, elsewhere always."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def examine(device: str | None = None) -> dict[str, Any]:
    """Return facts about this machine: Python, display, packages, devices, and OpenGL on one device."""
    findings: dict[str, Any] = {
        "python": platform.python_version(),
        "system": SYSTEM.name,
        "display": has_display(),
        "packages": {package: _version(package) for package in PACKAGES},
        "optional": {
            module: "present" if importlib.util.find_spec(module) else f"absent ({purpose})"
            for module, purpose in OPTIONAL_MODULES.items()
        },
    }
    findings["devices"] = [device.line for device in find_devices()] or [f"not listed: {SYSTEM.window_gpu}"]
    try:
        context = create_headless_context(device)
        information = context.info
        findings["opengl"] = {
            "renderer": information.renderer,
            "vendor": information.vendor,
            "version": information.version,
            "software": information.is_software,
            "decode_paths": ", ".join(drawable_paths(context)),
            "largest_uniform_block": context.features.uniform_block_bytes,
            "anisotropy": context.features.anisotropy,
            "timer_queries": context.features.timer_queries,
            "weights_in_image": context.features.weights_in_image,
            "decoder_variant": variant_name(context),
            "half_arithmetic": context.features.half_arithmetic or "none (--precision fp32 and fp16 only)",
        }
    except InputError as error:
        findings["opengl"] = {"error": str(error)}
    return findings


def _lines(findings: dict[str, Any], indent: str = "") -> list[str]:
    lines: list[str] = []
    for key, value in findings.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}:", *_lines(value, indent + "  ")]
        elif isinstance(value, list):
            lines += [f"{indent}{key}:", *(f"{indent}  {line}" for line in value)]
        else:
            lines.append(f"{indent}{key}: {value}")
    return lines


def doctor(options: DoctorOptions) -> int:
    """Run `ntc-viewer doctor`: 0 if pictures can be drawn, else 1."""
    findings = examine(options.device)
    sys.stdout.write((json.dumps(findings, indent=2) if options.json else "\n".join(_lines(findings))) + "\n")
    return 1 if "error" in findings["opengl"] else 0
