"""Which commands stand in which menu, in which order; lists that are empty, and commands that are only typed."""

from typing import Final

from viewer.commands.command import Menu

ORDER: Final[dict[Menu, tuple[tuple[str, ...], ...]]] = {
    "File": (
        ("file.open", "file.open-recent"),
        ("view.save", "view.load"),
        ("file.screenshot", "file.screenshot-picture"),
        ("file.quit",),
    ),
    "Edit": (
        ("edit.undo", "edit.redo"),
        ("view.copy", "view.paste"),
    ),
    "View": (
        ("materials.view", "materials.next"),
        ("view.whole",),
        ("view.resolution", "view.coarse-while-moving", "filter.anisotropy", "filter.texels"),
        ("light.environment", "light.exposure", "light.tone-map"),
    ),
    "Camera": (
        ("camera.frame-all", "camera.go", "camera.next"),
        ("camera.mode",),
        ("camera.bookmark", "camera.go-bookmark"),
        ("camera.toggle-turntable", "camera.record", "camera.play", "camera.stop"),
    ),
    "Compare": (
        ("compare.mode", "compare.next", "compare.divider"),
        ("slot.source", "slot.path", "slot.precision", "slot.maps", "slot.filter"),
        ("compare.swap", "slot.next-source", "slot.next-path"),
        ("compare.difference", "compare.gain"),
        ("compare.toggle-flicker",),
        ("compare.live", "compare.measure"),
    ),
    "Inspect": (
        ("pixel.panel", "errors.panel", "histogram.panel"),
        ("pixel.let-go", "errors.clear"),
        ("texture.flat", "texture.close-flat"),
    ),
    "Overlay": (
        ("overlay.toggle", "overlay.kind"),
        ("overlay.block", "overlay.next-block"),
        ("overlay.palette", "overlay.next-palette", "overlay.scale", "overlay.opacity"),
    ),
    "Train": (
        ("training.encode",),
        ("training.retrain", "training.move", "training.regroup"),
        ("training.pause", "training.resume", "training.cancel"),
        ("training.accept", "training.discard"),
        ("training.ahead",),
    ),
    "Window": (
        ("window.panels", "window.column", "window.panel", "window.stack", "log.panel"),
        ("window.theme", "window.ui-scale", "window.layout-reset"),
    ),
    "Help": (
        ("help.first-steps",),
        ("help.keys", "help.glossary"),
        ("help.palette",),
    ),
}
"""Sections of ids; a command that is in none of them, and not in ONLY_TYPED, follows at the end of its own menu."""

ONLY_TYPED: Final = frozenset(
    {
        "camera.look",
        "camera.next-mode",
        "camera.turntable",
        "compare.flicker",
        "errors.by",
        "errors.highlight",
        "errors.sort",
        "light.sun",
        "light.sun-strength",
        "light.turn",
        "pixel.keep",
        "texture.clear",
        "texture.select",
        "training.show",
        "view.magnify",
        "window.close",
        "window.dismiss",
    }
)
"""Commands for scripts, keys and the palette: panels or the mouse do the same."""
