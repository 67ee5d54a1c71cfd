"""Keys that run commands."""

from imgui_bundle import imgui

from viewer.commands import COMMANDS, bindings
from viewer.commands.keys import Chord
from viewer.state.session import Session
from viewer.ui.facts import Emit

_IMGUI_NAMES = {
    "PageUp": "page_up",
    "PageDown": "page_down",
    "Up": "up_arrow",
    "Down": "down_arrow",
    "Left": "left_arrow",
    "Right": "right_arrow",
    "/": "slash",
    ",": "comma",
    ".": "period",
    ";": "semicolon",
    "'": "apostrophe",
    "[": "left_bracket",
    "]": "right_bracket",
    "\\": "backslash",
    "-": "minus",
    "=": "equal",
    "`": "grave_accent",
    **{str(digit): f"_{digit}" for digit in range(10)},
}


def imgui_key(name: str) -> imgui.Key:
    """ImGui's key of a name of `viewer.commands.keys`."""
    key: imgui.Key = getattr(imgui.Key, _IMGUI_NAMES.get(name, name.lower()))
    return key


def is_pressed(chord: Chord) -> bool:
    """Whether the chord went down in this frame, with its modifiers and no others."""
    io = imgui.get_io()
    if (io.key_ctrl, io.key_shift, io.key_alt) != (chord.ctrl, chord.shift, chord.alt):
        return False
    return imgui.is_key_pressed(imgui_key(chord.key), repeat=False)


def run_commands(session: Session, emit: Emit, typing: bool) -> None:
    """Run the commands whose keys went down; while a field is typed into, only those of function keys."""
    if not typing:
        # Else ImGui takes Tab to go from field to field of the focused panel, and letters are typed from then on.
        imgui.internal.set_key_owner(imgui.Key.tab, imgui.get_id("commands"))
    bound = bindings(session.settings.keys)
    for command in COMMANDS:
        chords = bound.chords.get(command.id, ())
        if any(is_pressed(chord) for chord in chords if chord.is_function_key or not typing):
            if command.needs_arguments:
                emit("palette.set", command.id)
            else:
                emit(command.id)
