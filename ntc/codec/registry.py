"""The codecs there are, by name. Codec NAME is the package `ntc.codec.NAME`, whose module `codec` has the object `CODEC`."""

from functools import cache
from importlib import import_module
from typing import Final, Literal, get_args

from ntc.codec.codec import Codec
from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import CodecSettings

CodecName = Literal["block", "grid"]
"""The codecs that a user chooses from, the one first that is taken where all can do what is asked for."""
FIRST_NAME: Final = "grid"
"""The codec of files that name none: they were written before there was another one."""
SUMMARIES: Final[dict[str, str]] = {
    "block": "A learned linear transform of blocks of 8x8 or 4x4 texels: a scene is encoded in seconds, without a GPU.",
    "grid": "The published method: a grid of latents and a small network, trained together for minutes.",
}
"""A sentence about each codec, for the command line and the window."""
MODULES: Final[dict[str, str]] = {name: f"ntc.codec.{name}.codec" for name in get_args(CodecName)}
"""Module of each codec. It is imported when it is needed: a pack of one codec needs no other."""


@cache
def codec_named(name: str) -> Codec:
    """Return the codec of that name. Raises KeyError where there is none."""
    found: Codec = import_module(MODULES[name]).CODEC
    return found


def chosen_codec(choices: EncodingChoices) -> str:
    """Return the first codec that can do what is asked for. Where none can: the last of those that refuse least, which says why."""
    refusals: dict[str, int] = {}
    for name in MODULES:
        refusals[name] = len(codec_named(name).refusals(choices))
        if not refusals[name]:
            return name
    return min(reversed(refusals), key=refusals.__getitem__)


def shipping_codec() -> str:
    """Return the codec of which a decoder ships with the program (grouping `universal`)."""
    return next(name for name in MODULES if codec_named(name).shipped)


def codec_of(settings: CodecSettings) -> Codec:
    """Return the codec that `settings` belong to."""
    return codec_named(settings.kind)
