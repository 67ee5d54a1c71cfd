"""Commands: looking at single textures."""

from typing import Annotated

from ntc.errors import InputError
from viewer.commands.command import Arg, Context, command
from viewer.state.session import Session

Texture = Annotated[str, Arg("its number in the scene, or its name")]


def _none_flat(context: Context) -> str:
    return "no texture is shown flat" if context.session.inspection.flat_texture is None else ""


def _texture(session: Session, named: str) -> int:
    """The texture id that a number, else a name, stands for. Raises InputError."""
    textures = session.scene.textures
    if named.isdecimal() and len(named) < 10 and int(named) < len(textures):
        return int(named)
    found = [number for number, texture in enumerate(textures) if texture.name == named]
    if found:
        return found[0]
    raise InputError(f"texture {named!r}: no such texture; name one, or give its number below {len(textures)}")


@command("texture.select", "Select a texture", "mark a texture in all panels", "View")
def select(session: Session, texture: Texture) -> None:
    session.inspection.selected_texture = _texture(session, texture)


@command("texture.clear", "Select no texture", "mark no texture in the panels", "View")
def clear(session: Session) -> None:
    session.inspection.selected_texture = None


@command("texture.flat", "Texture by itself", "show a texture flat, the original beside the decoded one", "View")
def show_flat(session: Session, texture: Texture) -> None:
    session.inspection.selected_texture = session.inspection.flat_texture = _texture(session, texture)


@command(
    "texture.close-flat",
    "Close the flat texture",
    "close the window of the flat texture",
    "View",
    unavailable=_none_flat,
)
def close_flat(session: Session) -> None:
    session.inspection.flat_texture = None
