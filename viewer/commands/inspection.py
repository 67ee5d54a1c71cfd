"""Commands for inspection: the pixel inspector, errors of textures and decoders, their histogram, and single textures."""

from dataclasses import replace
from typing import Annotated, Literal

from ntc.errors import InputError
from viewer.commands.command import Arg, command, field_gesture, setter, unless
from viewer.commands.window import panel_command
from viewer.inspect.comparison import compared_source
from viewer.state.pack_files import match_scene
from viewer.state.session import ErrorColumn, ErrorsBy, Session

By = Annotated[ErrorsBy, Arg("rows of the list")]
LARGEST_IS_WORST: tuple[ErrorColumn, ...] = ("pixels", "mean", "max")


pixel_panel = panel_command("Pixel", "enlarge the pixels around the mouse in A and B", "I", icon="eye-dropper")


@command("pixel.keep", "Keep pixel", "keep a pixel of the picture in the panel Pixel")
def keep_pixel(
    session: Session,
    x: Annotated[int, Arg("pixels from the left of the window")],
    y: Annotated[int, Arg("pixels from the top of the window")],
) -> None:
    width, height = session.window.picture_size
    if not (0 <= x < width and 0 <= y < height):
        raise InputError(f"pixel.keep: {x} {y} lies outside the picture of {width} x {height} pixels")
    session.inspection.pixel = ((x + 0.5) / width, (y + 0.5) / height)
    session.window.open_panels |= {"Pixel"}


let_pixel_go = command(
    "pixel.let-go",
    "Release pixel",
    "let the panel Pixel follow the mouse again",
    unavailable=unless(
        lambda context: context.session.inspection.pixel,
        "no pixel is fixed; click on one while the panel Pixel is open",
    ),
)(setter("inspection.pixel", None))
keep_pixel_at = field_gesture("pixel.keep-at", "inspection.pixel")
keep_block_at = field_gesture("block.keep-at", "inspection.block")
hover = field_gesture("picture.hover", "inspection.hovered")
errors_panel = panel_command("Errors", "list textures or decoders by the difference between A and B", "U", icon="list")


def _change_table(session: Session, table: dict[str, object]) -> None:
    session.inspection.errors = replace(session.inspection.errors, **table)  # type: ignore[arg-type]
    session.window.open_panels |= {"Errors"}


@command(
    "errors.by",
    "Errors by",
    "list the errors by texture or by decoder",
    current=lambda session: session.inspection.errors.by,
)
def set_errors_by(session: Session, by: By) -> None:
    _change_table(session, {"by": by})


@command("errors.sort", "Sort errors", "sort the list of errors by a column")
def sort_errors(
    session: Session,
    column: Annotated[ErrorColumn, Arg("column")],
    order: Annotated[Literal["worst", "best", "ascending", "descending"], Arg("order")] = "worst",
) -> None:
    largest_is_worst = column in LARGEST_IS_WORST
    descending = {"ascending": False, "descending": True, "worst": largest_is_worst, "best": not largest_is_worst}
    _change_table(session, {"column": column, "descending": descending[order]})


def _textures_of_decoder(session: Session, decoder: int) -> tuple[int, ...]:
    """Return the ids of the textures that a decoder of the compared pack decodes."""
    pack = session.packs.get(compared_source(session.view))
    if pack is None or decoder < 0:
        return ()
    decoders = match_scene(pack, session.scene).decoders(pack)
    return tuple(texture for texture, number in enumerate(decoders) if number == decoder)


@command(
    "errors.highlight",
    "Highlight in the picture",
    "dim everything except a texture or a decoder's textures; the same again ends it",
)
def highlight(session: Session, by: By, number: Annotated[int, Arg("texture id or decoder")]) -> None:
    textures: tuple[int, ...]
    if by == "texture":
        textures = (number,) if 0 <= number < len(session.scene.textures) else ()
    else:
        textures = _textures_of_decoder(session, number)
    if not textures:
        raise InputError(f"errors.highlight: there is no {by} {number}")
    same = session.view.highlight == textures
    session.view = replace(session.view, highlight=() if same else textures)
    decoder = number if by == "decoder" and not same else None
    session.inspection.errors = replace(session.inspection.errors, highlighted_decoder=decoder)


@command(
    "errors.clear",
    "End highlight",
    "stop dimming the picture",
    unavailable=unless(lambda context: context.session.view.highlight, "nothing is highlighted"),
)
def end_highlight(session: Session) -> None:
    session.inspection.errors = replace(session.inspection.errors, highlighted_decoder=None)
    session.view = replace(session.view, highlight=())


histogram_panel = panel_command("Histogram", "plot pixels by the difference between A and B", icon="chart-column")


Texture = Annotated[str, Arg("number of the texture in the scene, or its name")]


def named_texture(session: Session, named: str) -> int:
    """Return the id of the texture with this number or name. Raises InputError."""
    textures = session.scene.textures
    if named.isdecimal() and len(named) < 10 and int(named) < len(textures):
        return int(named)
    numbers = [number for number, texture in enumerate(textures) if texture.name == named]
    if numbers:
        return numbers[0]
    raise InputError(f"texture {named!r}: no such texture; name one, or give its number below {len(textures)}")


@command("texture.select", "Select texture", "select a texture in all panels")
def select(session: Session, texture: Texture) -> None:
    session.inspection.selected_texture = named_texture(session, texture)


clear = command("texture.clear", "Clear selection", "deselect the texture in all panels")(
    setter("inspection.selected_texture", None)
)


@command("texture.flat", "Flat view", "show a texture flat, the original beside the decoded one")
def show_flat(session: Session, texture: Texture) -> None:
    session.inspection.selected_texture = session.inspection.flat_texture = named_texture(session, texture)


close_flat = command(
    "texture.close-flat",
    "Close flat view",
    "close the flat view of a texture",
    unavailable=unless(lambda c: c.session.inspection.flat_texture is not None, "no texture is shown flat"),
)(setter("inspection.flat_texture", None))
