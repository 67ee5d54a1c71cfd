"""Blender add-on: encodes textures with ntc-viewer, and shows them decoded. Its panel is in the sidebar of the 3D view."""

import shlex
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)
from bpy_extras.io_utils import ExportHelper

from . import program, swap

bl_info = {
    "name": "Neural textures (ntc-viewer)",
    "author": "ntc-viewer maintainers",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "View3D > Sidebar > NTC",
    "description": "Encode textures, see decoded ones in the viewport, export with the pack",
    "category": "Material",
}

TARGETS = {"BITS": ("--bits", "bits"), "QUALITY": ("--quality", "quality"), "SIZE": ("--size", "size")}
SECONDS = 0.2
"""Seconds between checks of a running program."""


class NTCPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    command: StringProperty(name="Command", description="Program to run, with arguments", default="ntc-viewer")

    def draw(self, _context: Any) -> None:
        """Draw the preferences."""
        self.layout.prop(self, "command")


class NTCRow(bpy.types.PropertyGroup):
    bits: FloatProperty()
    byte_count: IntProperty()
    psnr_db: FloatProperty()


def _show(settings: Any, _context: Any) -> None:
    swap.show(settings.show_decoded)


class NTCSettings(bpy.types.PropertyGroup):
    scope: EnumProperty(
        name="Materials",
        items=[("SCENE", "Scene", "All objects"), ("SELECTED", "Selection", "Selected objects")],
    )
    target: EnumProperty(
        name="Target",
        items=[
            ("BITS", "Bits", "Bits per texel, mips included"),
            ("QUALITY", "dB", "Minimum PSNR of each texture"),
            ("SIZE", "MB", "Largest size of the pack"),
        ],
    )
    bits: FloatProperty(name="Bits per texel", default=4.0, min=0.1, max=32.0)
    quality: FloatProperty(name="PSNR in dB", default=38.0, min=10.0, max=58.9)
    size: FloatProperty(name="Size in MB", default=10.0, min=0.01)
    show_decoded: BoolProperty(
        name="Show decoded", description="Show decoded images in place of the originals", update=_show
    )
    folder: StringProperty()
    pack_bytes: IntProperty()
    rows: CollectionProperty(type=NTCRow)
    progress: StringProperty()


class Steps:
    """A sequence of programs to run. `failure` is the last line of one that failed, else empty."""

    def __init__(self, commands: Sequence[Sequence[str]], folder: Path) -> None:
        self._commands, self._count, self._log = list(commands), len(commands), folder / "log.txt"
        self._process: subprocess.Popen[bytes] | None = None
        self._output = folder / "output.txt"
        self.outputs: list[str] = []
        self.failure = ""

    def wait(self, seconds: float | None) -> bool:
        """Wait up to `seconds` for a program (None: for all of them). Return whether all have ended."""
        while self._commands and not self.failure:
            if self._process is None:
                with self._log.open("wb") as log, self._output.open("wb") as output:
                    try:
                        self._process = subprocess.Popen(self._commands[0], stdout=output, stderr=log)
                    except OSError as error:
                        self.failure = f"{self._commands[0][0]}: {error.strerror}; set the command in the preferences"
                        break
            try:
                status = self._process.wait(seconds)
            except subprocess.TimeoutExpired:
                return False
            self._process = None
            self._commands.pop(0)
            self.outputs.append(self._output.read_text(encoding="utf-8", errors="replace"))
            if status != 0:
                self.failure = self._last_line or f"exit status {status}"
        return True

    @property
    def progress(self) -> str:
        """The current step and its last line of output."""
        return f"{len(self.outputs) + 1}/{self._count} {self._last_line}"

    @property
    def _last_line(self) -> str:
        text = self._log.read_text(encoding="utf-8", errors="replace") if self._log.exists() else ""
        return next((line.strip() for line in reversed(text.replace("\r", "\n").split("\n")) if line.strip()), "")

    def stop(self) -> None:
        """End the running program, and run no others."""
        self._commands.clear()
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._process = None


def _program(context: Any) -> list[str]:
    return shlex.split(context.preferences.addons[__package__].preferences.command)


class _Running:
    """Base of operators that run programs. Without a window they wait; in a window they check on a timer until Escape."""

    _steps: Steps
    _timer: Any

    def begin(self, context: Any, commands: Sequence[Sequence[str]], folder: Path) -> set[str]:
        """Run `commands`, then call `finish`."""
        self._steps = Steps(commands, folder)
        if bpy.app.background:
            self._steps.wait(None)
            return self.end(context)
        self._timer = context.window_manager.event_timer_add(SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Check on the program, and show its progress."""
        settings = context.scene.ntc
        if event.type == "ESC":
            self._steps.stop()
            self._steps.failure = "stopped"
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        done = self._steps.wait(0.0)
        settings.progress = "" if done else self._steps.progress
        for area in context.screen.areas:
            area.tag_redraw()
        if not done:
            return {"RUNNING_MODAL"}
        context.window_manager.event_timer_remove(self._timer)
        return self.end(context)

    def end(self, context: Any) -> set[str]:
        """Call `finish` with the outputs, or report the failure."""
        if self._steps.failure:
            self.report({"ERROR"}, self._steps.failure)
            return {"CANCELLED"}
        self.finish(context, self._steps.outputs)
        return {"FINISHED"}

    report: Callable[[set[str], str], None]
    finish: Callable[[Any, list[str]], None]


class NTC_OT_encode(_Running, bpy.types.Operator):
    """Encode the textures of the materials, and decode them again"""

    bl_idname = "ntc.encode"
    bl_label = "Encode"

    def execute(self, context: Any) -> set[str]:
        """Export the scene and start ntc-viewer."""
        settings = context.scene.ntc
        settings.show_decoded = False
        swap.forget()
        settings.rows.clear()
        folder = Path(tempfile.mkdtemp(prefix="ntc-", dir=bpy.app.tempdir or None))
        settings.folder = str(folder)
        selected = settings.scope == "SELECTED"
        scene = str(program.scene_path(folder))
        bpy.ops.export_scene.gltf(filepath=scene, export_format="GLB", use_selection=selected)
        option, name = TARGETS[settings.target]
        target = (option, f"{getattr(settings, name):g}")
        return self.begin(context, program.encode_commands(_program(context), folder, target), folder)

    def finish(self, context: Any, outputs: list[str]) -> None:
        """Fill the table, and assign decoded images to image nodes."""
        settings = context.scene.ntc
        encoded = program.read_encoded(Path(settings.folder), outputs[1])
        settings.pack_bytes = encoded.pack_bytes
        for each in encoded.rows:
            row = settings.rows.add()
            row.name, row.bits, row.byte_count, row.psnr_db = each.material, each.bits, each.byte_count, each.psnr_db
        count = swap.add_decoded(encoded.images)
        settings.show_decoded = True
        self.report({"INFO"}, f"{count} images are shown decoded; the pack has {encoded.pack_bytes / 1e6:.2f} MB")


class NTC_OT_export(_Running, bpy.types.Operator, ExportHelper):
    """Write the encoded scene as glTF that names its pack, which lies beside it"""

    bl_idname = "ntc.export"
    bl_label = "Export glTF with pack"

    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})
    fallback: EnumProperty(
        name="Other images",
        description="What programs without a decoder show",
        items=[
            ("original", "Original", "The original images"),
            ("jpeg", "JPEG", "The same as JPEG"),
            ("none", "None", "Nothing: the file needs a decoder"),
        ],
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """True if something is encoded."""
        return bool(context.scene.ntc.folder) and program.pack_path(Path(context.scene.ntc.folder)).is_file()

    def execute(self, context: Any) -> set[str]:
        """Start the export by ntc-viewer."""
        folder = Path(context.scene.ntc.folder)
        out = Path(bpy.path.abspath(self.filepath))
        return self.begin(context, [program.export_command(_program(context), folder, out, self.fallback)], folder)

    def finish(self, _context: Any, outputs: list[str]) -> None:
        """Report which file was written."""
        self.report({"INFO"}, outputs[0].strip().split("\n")[-1])


class NTC_OT_forget(bpy.types.Operator):
    """Show the original images, and remove decoded ones from the file"""

    bl_idname = "ntc.forget"
    bl_label = "Remove decoded images"

    def execute(self, context: Any) -> set[str]:
        """Remove the decoded images."""
        context.scene.ntc.show_decoded = False
        swap.forget()
        context.scene.ntc.rows.clear()
        return {"FINISHED"}


class NTC_PT_panel(bpy.types.Panel):
    bl_label = "Neural textures"
    bl_idname = "NTC_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "NTC"

    def draw(self, context: Any) -> None:
        """Draw the panel."""
        layout, settings = self.layout, context.scene.ntc
        layout.row().prop(settings, "scope", expand=True)
        layout.row().prop(settings, "target", expand=True)
        layout.prop(settings, TARGETS[settings.target][1])
        if settings.progress:
            layout.label(text=f"{settings.progress} (Esc stops)", icon="SORTTIME")
        else:
            layout.operator("ntc.encode", icon="TEXTURE")
        if not len(settings.rows):
            return
        layout.prop(settings, "show_decoded", toggle=True, icon="HIDE_OFF" if settings.show_decoded else "HIDE_ON")
        table = layout.box().column(align=True)
        for texts in (
            ("Material", "Bits", "kB", "dB"),
            *(
                (row.name, f"{row.bits:.2f}", f"{row.byte_count / 1e3:.0f}", f"{row.psnr_db:.1f}")
                for row in settings.rows
            ),
        ):
            split = table.split(factor=0.46)
            split.label(text=texts[0])
            for text in texts[1:]:
                split.label(text=text)
        layout.label(text=f"Pack: {settings.pack_bytes / 1e6:.2f} MB")
        layout.operator("ntc.export", icon="EXPORT")
        layout.operator("ntc.forget", icon="TRASH")


CLASSES = (NTCPreferences, NTCRow, NTCSettings, NTC_OT_encode, NTC_OT_export, NTC_OT_forget, NTC_PT_panel)


def register() -> None:
    """Add the panel and its operators."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.ntc = PointerProperty(type=NTCSettings)


def unregister() -> None:
    """Remove the panel and its operators."""
    del bpy.types.Scene.ntc
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
