"""Commands: looking at single textures."""

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter
from viewer.state.session import Session


def _texture(session: Session, named: str) -> int:
    """The texture id that a number, else a name, stands for. Raises InputError."""
    textures = session.scene.textures
    if named.isdecimal() and len(named) < 10 and int(named) < len(textures):
        return int(named)
    found = [number for number, texture in enumerate(textures) if texture.name == named]
    if found:
        return found[0]
    raise InputError(f"texture {named!r}: no such texture; name one, or give its number below {len(textures)}")


def _select(session: Session, named: str) -> None:
    session.selected_texture = _texture(session, named)


def _clear(session: Session) -> None:
    session.selected_texture = None


def _flat(session: Session, named: str) -> None:
    session.selected_texture = session.flat_texture = _texture(session, named)


def _close_flat(session: Session) -> None:
    session.flat_texture = None


TEXTURE = Parameter("texture", "text", "its number in the scene, or its name")
COMMANDS = (
    Command("texture.select", "Select texture", "highlight a texture in all panels", "View", _select, (TEXTURE,)),
    Command("texture.clear", "Select no texture", "highlight none", "View", _clear),
    Command("texture.flat", "Texture flat", "show a texture flat, original and decoded", "View", _flat, (TEXTURE,)),
    Command("texture.close-flat", "Close flat texture", "close the window of the texture", "View", _close_flat),
)
