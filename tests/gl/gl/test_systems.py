"""Contexts without a window on other systems, whose library EGL stands in for, behind the interface that glcontext has there."""

import json
from typing import Any

import glcontext
import numpy as np
import pytest

from ntc.errors import InputError
from viewer import cli
from viewer.gl.context import create_headless_context
from viewer.gl.devices import DEVICE_VARIABLE, SOFTWARE, find_devices
from viewer.gl.features import DRAWING_VERSION
from viewer.gl.systems import LINUX, WINDOWS, make_context


class OtherLibrary:
    """What `glcontext.default_backend()` gives on Windows. `newest`: version of the driver; `lacking`: functions that it has not."""

    def __init__(self, newest: int = 460, lacking: tuple[str, ...] = ()) -> None:
        self.newest, self.lacking = newest, lacking
        self.asked: list[dict[str, Any]] = []
        self.loaded: list[str] = []
        self._made: Any = None

    def __call__(self, **asked: Any) -> "OtherLibrary":
        self.asked.append(asked)
        if asked["glversion"] > self.newest:
            raise Exception("wglCreateContextAttribsARB failed")
        self._made = glcontext.get_backend_by_name("egl")(mode=asked["mode"], glversion=asked["glversion"])
        return self

    def load_opengl_function(self, name: str) -> int:
        return int(self._made.load(name))

    def load(self, name: str) -> int:
        self.loaded.append(name)
        # Some drivers' wglGetProcAddress says -1, 1, 2 or 3 where others say 0.
        return (1 << 64) - 1 if name in self.lacking else int(self._made.load(name))

    def release(self) -> None:
        self._made.release()

    def __enter__(self) -> "OtherLibrary":
        self._made.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._made.__exit__()


def on_windows(monkeypatch: pytest.MonkeyPatch, library: OtherLibrary) -> None:
    """Let glcontext be that of Windows: no EGL, and this library by default."""
    egl = glcontext.get_backend_by_name("egl")
    library_egl = {"egl": egl}
    monkeypatch.setattr(glcontext, "default_backend", lambda: library)
    monkeypatch.setattr(glcontext, "get_backend_by_name", lambda name: library_egl[name])


@pytest.mark.computes
def test_windows_draws_without_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    library = OtherLibrary()
    on_windows(monkeypatch, library)
    context = create_headless_context(system=WINDOWS)
    assert library.asked == [{"mode": "standalone", "glversion": 430, "device_index": 0}]
    assert "glTextureView" in library.loaded
    texture = context.memory.texture("a test", (4, 4), 4)
    framebuffer = context.memory.framebuffer("a test", [texture])
    framebuffer.clear(0.0, 1.0, 0.0, 1.0)
    assert np.frombuffer(texture.read(), np.uint8).reshape(-1, 4).tolist() == [[0, 255, 0, 255]] * 16
    context.gl.release()


@pytest.mark.parametrize(
    ("library", "parts"),
    [
        (OtherLibrary(newest=400), ("OpenGL 4.1 is required", "the driver offers", "update it", "opengl32.dll")),
        (OtherLibrary(newest=110), ("wglCreateContextAttribsARB failed", "install the driver of the GPU's maker")),
        pytest.param(
            OtherLibrary(lacking=("glTextureView",)),
            ("has no glTextureView; update the driver",),
            marks=pytest.mark.computes,
        ),
    ],
    ids=["too old", "Windows' own driver", "a function is missing"],
)
def test_what_windows_lacks_is_one_line_with_its_own_advice(
    library: OtherLibrary, parts: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    on_windows(monkeypatch, library)
    with pytest.raises(InputError) as raised:
        create_headless_context(system=WINDOWS)
    line = str(raised.value)
    assert all(part in line for part in parts), line
    assert "apt-get" not in line
    assert "\n" not in line


def test_devices_are_listed_and_chosen(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    found = find_devices(LINUX)
    assert [device.index for device in found] == list(range(len(found)))
    usable = next(device for device in found if device.version)
    gl, _ = make_context(DRAWING_VERSION, usable.index)
    assert gl.info["GL_RENDERER"] == usable.renderer
    gl.release()
    assert not find_devices(WINDOWS)
    capsys.readouterr()
    assert cli.main(["doctor", "--json", "--device", str(usable.index)]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert findings["devices"] == [device.line for device in found]
    assert findings["opengl"]["renderer"] == usable.renderer
    monkeypatch.setenv(DEVICE_VARIABLE, "no such thing")
    with pytest.raises(InputError, match="--device no such thing: no such device"):
        create_headless_context()


def test_a_device_without_a_gpu_can_be_asked_for() -> None:
    if not any(device.version and "llvmpipe" in device.renderer for device in find_devices(LINUX)):
        pytest.skip("no software renderer among EGL's devices")
    context = create_headless_context(SOFTWARE)
    assert context.info.is_software
    context.gl.release()


@pytest.mark.parametrize("command", [["render", "--out", "o"], ["decode", "p.ntc", "--out", "o", "--backend", "numpy"]])
def test_a_device_that_cannot_be_used_is_refused(
    command: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main([*command, "--device", "99"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    assert "--device 99" in lines[0]
    assert not (tmp_path / "o").exists()
