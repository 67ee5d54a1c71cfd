"""Commands: the pixel inspector, the errors of textures and decoders, their histogram."""

from dataclasses import replace

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.inspect.comparison import compared_source
from viewer.state.comparing_panels import ErrorColumn, ErrorsBy, worst_is_largest
from viewer.state.pack_files import match_scene
from viewer.state.session import Session


def _pixel_panel(session: Session) -> None:
    session.comparing = replace(session.comparing, pixel=not session.comparing.pixel)


def _errors_panel(session: Session) -> None:
    session.comparing = replace(session.comparing, errors=not session.comparing.errors)


def _histogram_panel(session: Session) -> None:
    session.comparing = replace(session.comparing, histogram=not session.comparing.histogram)


def _keep(session: Session, x: int, y: int) -> None:
    width, height = session.picture_size
    if not (0 <= x < width and 0 <= y < height):
        raise InputError(f"pixel.keep: {x} {y} lies outside the picture of {width} x {height} pixels")
    session.kept_pixel = ((x + 0.5) / width, (y + 0.5) / height)
    session.comparing = replace(session.comparing, pixel=True)


def _let_go(session: Session) -> None:
    session.kept_pixel = None


def _by(session: Session, by: ErrorsBy) -> None:
    session.comparing = replace(session.comparing, errors=True, errors_by=by)


def _sort(session: Session, column: ErrorColumn, order: str) -> None:
    largest_first = worst_is_largest(column)
    descending = {"ascending": False, "descending": True, "worst": largest_first, "best": not largest_first}[order]
    session.comparing = replace(session.comparing, errors=True, column=column, descending=descending)


def decoder_textures(session: Session, decoder: int) -> tuple[int, ...]:
    """Ids of the textures that a decoder of the compared pack decodes."""
    pack = session.packs.get(compared_source(session.view))
    if pack is None:
        return ()
    decoders = match_scene(pack, session.scene).decoders(pack)
    return tuple(texture for texture, of_texture in enumerate(decoders) if of_texture == decoder)


def _highlight(session: Session, by: ErrorsBy, number: int) -> None:
    lit: tuple[int, ...]
    if by == "texture":
        lit = (number,) if 0 <= number < len(session.scene.textures) else ()
    else:
        lit = decoder_textures(session, number) if number >= 0 else ()
    if not lit:
        raise InputError(f"errors.highlight: there is no {by} {number}")
    same = session.view.highlight == lit
    session.view = replace(session.view, highlight=() if same else lit)
    decoder = number if by == "decoder" and not same else None
    session.comparing = replace(session.comparing, lit_decoder=decoder)


def _clear(session: Session) -> None:
    session.comparing = replace(session.comparing, lit_decoder=None)
    session.view = replace(session.view, highlight=())


X = Parameter("x", "whole", "pixels from the left of the window")
Y = Parameter("y", "whole", "pixels from the top of the window")
BY = Parameter("by", "choice", "what errors are told apart by", fixed("texture", "decoder"))
NUMBER = Parameter("number", "whole", "texture id or decoder")
COLUMN = Parameter("column", "choice", "to sort by", fixed("name", "decoder", "pixels", "psnr", "mean", "max"))
ORDER = Parameter("order", "choice", "which first", fixed("worst", "best", "ascending", "descending"), "worst")
COMMANDS = (
    Command(
        "pixel.panel", "Pixel", "look at one pixel and its surroundings in A and B", "Inspect", _pixel_panel, key="I"
    ),
    Command(
        "pixel.keep", "Keep a pixel", "keep a pixel of the whole picture in the panel Pixel", "Inspect", _keep, (X, Y)
    ),
    Command("pixel.let-go", "Let the pixel go", "follow the mouse again", "Inspect", _let_go),
    Command("errors.panel", "Errors", "list textures and decoders by their error", "Inspect", _errors_panel, key="U"),
    Command("errors.by", "Errors by", "list the errors of textures or of decoders", "Inspect", _by, (BY,)),
    Command("errors.sort", "Sort errors", "sort the list of errors", "Inspect", _sort, (COLUMN, ORDER)),
    Command(
        "errors.highlight",
        "Highlight",
        "dim all but a texture, or a decoder's textures; once more ends it",
        "Inspect",
        _highlight,
        (BY, NUMBER),
    ),
    Command("errors.clear", "End highlight", "dim nothing", "Inspect", _clear),
    Command("histogram.panel", "Histogram", "how many pixels differ by how much", "Inspect", _histogram_panel),
)
