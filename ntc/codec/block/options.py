"""How codec `block` encodes. Needs no torch."""

from dataclasses import dataclass

from ntc.codec.encoding import EncodingOptions


@dataclass(frozen=True)
class BlockOptions(EncodingOptions):
    """How textures are encoded under settings that are known."""

    seed: int = 0
    """Decides which blocks tables are fitted to."""
    groups_apart: bool = False
    """Whether each group shares its words among its own textures, so that a group is the same whichever others are encoded. Else all
    textures share all words."""
    quality_db: float | None = None
    """PSNR that each texture is to have at mip 0; it decides about the words. None: the settings do."""
    worth: tuple[float, ...] | None = None
    """What an error is worth in each texture, positive, in proportion; None: the same in all."""
    balance: float = 1.0
    """How textures share words: 0 makes the mean squared error of all texels least, 1 the mean PSNR of the textures greatest."""
    threads: int | None = None
    """Most threads; None: as many as pay."""
