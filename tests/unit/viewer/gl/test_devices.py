"""Which GPU of several is meant, without any."""

import pytest

from ntc.errors import InputError
from viewer.gl import devices
from viewer.gl.devices import DEVICE_VARIABLE, SOFTWARE, SOFTWARE_VARIABLE, Device, choose_device, device_number
from viewer.gl.systems import LINUX, MACOS, WINDOWS, GraphicsSystem, system_of

MACHINE = (
    Device(0, "NVIDIA GeForce RTX 4070/PCIe/SSE2", "4.6.0 NVIDIA 570", "/dev/dri/card0"),
    Device(1, "NVIDIA GeForce RTX 4070/PCIe/SSE2", "4.6.0 NVIDIA 570", "/dev/dri/card1"),
    Device(2, "AMD Radeon 780M (radeonsi)", "4.6 Mesa 26.1", "/dev/dri/card2"),
    Device(3, "eglInitialize failed (0x3001)", "", "/dev/dri/card3"),
    Device(4, "llvmpipe (LLVM 19)", "4.5 Mesa 26.1", ""),
    Device(5, "softpipe", "3.3 Mesa 26.1", ""),
)


@pytest.mark.parametrize(
    ("choice", "index"),
    [("0", 0), ("2", 2), (" 3 ", 3), ("radeon", 2), ("780M", 2), ("card1", 1), ("LLVMpipe", 4), (SOFTWARE, 4)],
)
def test_a_device_is_named_by_number_name_or_file(choice: str, index: int) -> None:
    assert choose_device(choice, MACHINE) == index


@pytest.mark.parametrize(
    ("choice", "word"),
    [("6", "no such device"), ("-1", "no such device"), ("intel", "no such device"), ("4070", "matches several")],
)
def test_what_names_none_or_several_is_one_line_with_all(choice: str, word: str) -> None:
    with pytest.raises(InputError, match=word) as raised:
        choose_device(choice, MACHINE)
    assert "2: AMD Radeon 780M (radeonsi), OpenGL 4.6 Mesa 26.1, /dev/dri/card2" in str(raised.value)
    assert "3: unusable (eglInitialize failed (0x3001))" in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """MACHINE in place of this one, and nothing chosen in the environment."""
    monkeypatch.setattr(devices, "find_devices", lambda _system: MACHINE)
    monkeypatch.setattr(devices, "_device_files", lambda: tuple(device.file for device in MACHINE))
    for variable in (DEVICE_VARIABLE, SOFTWARE_VARIABLE):
        monkeypatch.delenv(variable, raising=False)


@pytest.mark.usefixtures("machine")
def test_option_goes_before_environment_and_that_before_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    assert device_number(None, LINUX) == 0
    # Mesa refuses to start a GPU's device under its variable: it has to mean the device.
    monkeypatch.setenv(SOFTWARE_VARIABLE, "true")
    assert device_number(None, LINUX) == 4
    monkeypatch.setenv(DEVICE_VARIABLE, "radeon")
    assert device_number(None, LINUX) == 2
    assert device_number("card1", LINUX) == 1


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize(("system", "word"), [(WINDOWS, "High performance"), (MACOS, "Battery")])
def test_where_the_system_chooses_it_is_said_how(
    system: GraphicsSystem, word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SOFTWARE_VARIABLE, "1")
    assert device_number(None, system) == 0
    with pytest.raises(InputError, match=f"--device 1: .*{word}"):
        device_number("1", system)


def test_every_platform_has_a_system() -> None:
    assert [system_of(name).name for name in ("linux", "win32", "darwin", "freebsd14")] == [
        "Linux",
        "Windows",
        "macOS",
        "Linux",
    ]
