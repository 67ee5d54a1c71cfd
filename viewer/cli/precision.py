"""`--precision auto`: halves where they do not show."""

import sys

from ntc.accuracy.precision_choice import chosen_precision
from ntc.codec.precision import Precision, PrecisionChoice
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.render.resources.precision import EVERYWHERE, supported_precisions


def resolve_precision(choice: PrecisionChoice, pack: Pack | None, context: GraphicsContext | None) -> Precision:
    """The precision that `choice` means for `pack`; for `auto` it is said which one was taken, and why.

    Without a pack nothing is decoded; without a context only what every driver can do is taken.
    """
    if choice != "auto":
        return choice
    if pack is None:
        return "fp32"
    chosen = chosen_precision(pack, EVERYWHERE if context is None else supported_precisions(context))
    sys.stdout.write(f"precision {chosen.precision}: {chosen.reason}\n")
    return chosen.precision
