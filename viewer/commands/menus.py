"""Menus: the commands of each menu, in sections."""

from typing import Final

from viewer.commands import BY_ID

ORDER: Final[dict[str, str]] = {
    "File": "file.open file.open-recent | view.save view.load | file.screenshot file.screenshot-picture | file.export | file.quit",
    "Edit": "edit.undo edit.redo | view.copy view.paste",
    "View": "materials.view materials.next | view.whole | "
    "view.resolution view.coarse-while-moving filter.anisotropy filter.texels | "
    "light.environment light.exposure light.tone-map | "
    "materials.variant animation.play animation.time animation.rest animation.speed animation.repeat",
    "Camera": "camera.frame-all camera.go camera.next | camera.mode | camera.bookmark camera.go-bookmark | "
    "camera.toggle-turntable camera.record camera.play camera.stop",
    "Compare": "compare.mode compare.next compare.divider | slot.source slot.path slot.precision slot.maps slot.filter | "
    "compare.swap slot.next-source slot.next-path | compare.difference compare.gain | compare.toggle-flicker | "
    "compare.live compare.measure compare.copy-figures compare.save-figures",
    "Inspect": "pixel.panel errors.panel histogram.panel | pixel.let-go errors.clear | texture.flat texture.close-flat",
    "Overlay": "overlay.toggle overlay.kind | overlay.block overlay.next-block | "
    "overlay.palette overlay.next-palette overlay.scale overlay.opacity",
    "Train": "training.encode | training.retrain training.move training.regroup | "
    "training.pause training.resume training.cancel | training.keep training.discard | training.ahead",
    "Window": "window.panels window.column window.panel window.stack log.panel | "
    "window.theme window.ui-scale window.layout-reset",
    "Help": "help.first-steps | help.keys help.glossary | help.palette",
}
"""Ids of the commands of each menu; `|` separates sections. All other commands are in ONLY_TYPED."""

_TYPED = (
    "camera.look camera.next-mode camera.turntable compare.flicker errors.by errors.highlight errors.sort light.sun "
    "light.sun-azimuth light.sun-elevation light.sun-strength light.turn pixel.keep texture.clear texture.select training.anew "
    "training.choose training.measure-rates training.show view.magnify window.dismiss"
)
ONLY_TYPED: Final = frozenset(_TYPED.split())
"""Ids of the commands without a menu item, because panels or the mouse do the same."""

MENUS: Final = {
    menu: tuple(tuple(BY_ID[command_id] for command_id in section.split()) for section in sections.split("|"))
    for menu, sections in ORDER.items()
}
"""Commands of each menu by sections."""
