"""Material sets in codec `block`: maps together, and each part alone in the same bits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from lab.studies.materials.coding import CodedMaps, Coding, Part, joined, mean_psnr_db, part_of
from lab.studies.materials.hardware import present_parts
from lab.studies.set_quality import pack_bits_per_texel, texel_count
from lab.studies.settings import BlockSide
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.maps import BASE_ALONE, EQUAL_WEIGHTS, MAP_WEIGHTS, MapWeightsName
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture
from ntc.grouping import kinds_of
from ntc.training.encode import encode_textures

LARGEST_BITS = 15.0
"""More take blocks of 4x4 texels: codes of 8x8 texels have no more than 16 bits a texel, those of base colours alone 8."""
SHARES: tuple[tuple[float, float, float, float], ...] = (
    (0.40, 0.30, 0.30, 0.40),
    (0.35, 0.35, 0.30, 0.35),
    (0.35, 0.30, 0.35, 0.35),
)
"""By part, in the order of PARTS: what each gets of the bits where maps are encoded alone. The best of them counts."""
Report = Callable[[str], None]


def _side(textures: Sequence[SourceTexture], bits: float) -> BlockSide:
    """Texels of a block along one side."""
    alone = all(texture.maps == BASE_ALONE for texture in textures)
    return 8 if bits <= (0.5 if alone else 1.0) * LARGEST_BITS else 4


def grouped_by_maps(textures: Sequence[SourceTexture]) -> Grouping:
    """Textures with the same maps share a decoder."""
    labels = {index: kind for kind, members in enumerate(kinds_of(textures)) for index in members}
    return Grouping.of_labels("by maps", [labels[index] for index in range(len(textures))], {})


def _encoded(textures: Sequence[SourceTexture], bits: float) -> tuple[list[CodedMaps], float]:
    """(each texture decoded, stored bits in all) where textures of one kind share a decoder."""
    grouping = grouped_by_maps(textures)
    config = config_for_bits(bits, texture_set(textures, grouping.group_count), _side(textures, bits))
    pack = encode_textures(textures, grouping, config, BlockOptions())
    codec = codec_of(pack.config).torch_twin(pack, "cpu")
    coded = [
        CodedMaps.of(texture.maps, codec.decode_image(index), texture.pixels) for index, texture in enumerate(textures)
    ]
    return coded, pack_bits_per_texel(pack) * texel_count([texture.size for texture in textures])


def together(textures: Sequence[SourceTexture], bits: float, weights: MapWeightsName) -> Coding:
    """All maps of a material as one texture."""
    coded, stored = _encoded([replace(texture, map_weights=MAP_WEIGHTS[weights]) for texture in textures], bits)
    return Coding(tuple(coded), stored)


def _part_alone(textures: Sequence[SourceTexture], part: Part, bits: float) -> Coding:
    owned = [part_of(texture, part) for texture in textures]
    coded, stored = _encoded([replace(own, map_weights=EQUAL_WEIGHTS) for own in owned if own is not None], bits)
    found = iter(coded)
    return Coding(tuple(None if own is None else next(found) for own in owned), stored)


def _bits_of_parts(textures: Sequence[SourceTexture], parts: Mapping[Part, float], bits: float) -> dict[Part, float]:
    """Bits a texel of each part, whose shares are `parts`, that come to `bits` a texel of the materials."""
    whole, taken = texel_count([texture.size for texture in textures]), 0.0
    for part, share in parts.items():
        own = [texture.size for texture in textures if part_of(texture, part) is not None]
        taken += share * texel_count(own) / whole
    return {part: round(bits * share / taken, 3) for part, share in parts.items()}


def alone(textures: Sequence[SourceTexture], bits: float, report: Report) -> Coding:
    """Each part of the materials as textures of their own, in the best of SHARES."""
    present, known = present_parts(textures), dict[tuple[Part, float], Coding]()
    best: Coding | None = None
    for shares in SHARES:
        given = dict(zip(present, shares, strict=False))
        chosen = []
        for part, own in _bits_of_parts(textures, given, bits).items():
            if (part, own) not in known:
                report(f"{' '.join(part)} alone, {own:g} bits")
                known[part, own] = _part_alone(textures, part, own)
            chosen.append(known[part, own])
        coding = joined(chosen)
        if best is None or mean_psnr_db(coding) > mean_psnr_db(best):
            best = coding
    assert best is not None
    return best
