"""Codec `block` with codes of their own for mips that would be derived poorly, beside as many mips per code for all textures.

python -m lab.benchmarks.own_codes SCENE|FOLDER --json FILE: PSNR in dB of mips 0 to 3 of each texture whose layout differs, or of
which a mip is below mip 0, at equal bytes in all.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.commands.rate_points import read_textures
from lab.runner import options, report, run
from ntc.api import decode
from ntc.codec.block.codec import BlockCodec
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.model import block_parts
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import BitsTarget, EncodingChoices, texture_set
from ntc.codec.mips import mip_chain
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.codec.textures import SourceTexture
from ntc.grouping import GroupingInputs, make_grouping
from ntc.training.encode import encode_textures

MIPS = 4
MOST_DB = 99.0
BELOW_DB = 0.25


def quality(pack: Pack, textures: list[SourceTexture]) -> NDArray[np.float64]:
    """Return [textures, MIPS] PSNR in dB, at most MOST_DB."""
    found = np.full((len(textures), MIPS), np.nan)
    for index, texture in enumerate(textures):
        for mip, truth in enumerate(mip_chain(texture.pixels, texture.color_space, texture.maps)[:MIPS]):
            found[index, mip] = min(psnr_db(decode(pack, index, mip), truth), MOST_DB)
    return found


def _row(name: str, layout: str, psnrs: NDArray[np.float64], stored: int) -> dict[str, Any]:
    mips = {f"mip {mip}": round(float(own), 2) for mip, own in enumerate(psnrs)}
    return {"texture": name, "mips per code": layout, **mips, "kB": round(stored / 1000.0, 1)}


def main() -> None:
    """Run the benchmark. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("--texture-size", type=int, default=512)
    parser.add_argument("--most", type=int, default=1000)
    parser.add_argument("--clusters", type=int, default=4)
    parser.add_argument("--bits", type=float, default=2.0)
    given = parser.parse_args()
    textures = list(read_textures(given.source, given.texture_size, given.most))
    config = GroupingConfig("clustered", min(given.clusters, len(textures)))
    grouping = make_grouping(config, textures, GroupingInputs())
    settings = BlockCodec().settings_for(
        texture_set(textures, grouping.group_count), EncodingChoices(target=BitsTarget(given.bits))
    )
    packs, seconds = [], []
    for own_codes in (False, True):
        started = time.process_time()
        packs.append(encode_textures(textures, grouping, settings, BlockOptions(own_codes=own_codes)))
        seconds.append(time.process_time() - started)
    before, after = (quality(pack, textures) for pack in packs)
    stored = [[own.words.nbytes for own in block_parts(pack).textures] for pack in packs]
    rows = []
    below = before[:, 1:].min(1) < before[:, 0] - BELOW_DB
    for index, texture in enumerate(textures):
        chosen = packs[1].textures[index].code_mips
        if chosen is not None or below[index]:
            rows.append(_row(texture.name, "as all", before[index], stored[0][index]))
        if chosen is not None:
            rows.append(_row(texture.name, str(chosen), after[index], stored[1][index]))
    rows += [
        _row("mean of all", layout, found.mean(0), sum(sizes))
        for layout, found, sizes in (("as all", before, stored[0]), ("own", after, stored[1]))
    ]
    facts = {
        "textures": len(textures),
        "side": given.texture_size,
        "bits": given.bits,
        "with fewer mips per code": sum(own.code_mips is not None for own in packs[1].textures),
        **{
            f"{what}, {when}": value
            for when, found in (("before", before), ("after", after))
            for what, value in (
                ("textures with a mip below mip 0", int((found[:, 1:].min(1) < found[:, 0] - BELOW_DB).sum())),
                ("worst mip below mip 0, dB", round(float((found[:, 0] - found[:, 1:].min(1)).max()), 2)),
            )
        },
        "CPU seconds": [round(each, 1) for each in seconds],
    }
    report("Own codes", rows, facts, given.json)


if __name__ == "__main__":
    run(main)
