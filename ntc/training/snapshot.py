"""Snapshots of groups under training, and packs in which groups are replaced one by one. Needs no torch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.storage import BlockCodes, stored_words
from ntc.codec.block.universal import UNIVERSAL
from ntc.codec.block_pack import encoded_block_texture
from ntc.codec.config import CodecConfig
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import channel_places
from ntc.codec.model import Adapter, AnyDecoder, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.quantize import QuantizedLatents
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

MEANT_TEXELS = 64
"""Along one side: so many texels at least, where there are, give a texture's mean colour."""


@dataclass(frozen=True, eq=False)
class GroupSnapshot:
    """A group as a pack stores it, at one moment of its training."""

    version: int
    """1 for the first of this group in a training, then one more each time."""
    group: int
    """Its number in the grouping that is trained for."""
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[EncodedTexture, ...]
    """The members; in codec `grid` without PSNR unless final."""
    decoder: AnyDecoder
    final: bool = False
    """Whether training of this group has ended with this."""


def encoded_texture(
    source: SourceTexture, group: int, latents: QuantizedLatents, adapter: Adapter | None
) -> EncodedTexture:
    """`source` in `group`, encoded as `latents` and, where the codec has them, `adapter`; its PSNR is not yet known."""
    width, height = source.size
    return EncodedTexture(
        name=source.name,
        pixel_hash=source.pixel_hash,
        width=width,
        height=height,
        channels=source.channels,
        color_space=source.color_space,
        wrap=source.wrap,
        category=source.category,
        group=group,
        latents=latents.stored,
        scale=latents.scale,
        offset=latents.offset,
        adapter=adapter,
        maps=source.maps,
    )


def apply_snapshot(pack: Pack, snapshot: GroupSnapshot) -> Pack:
    """`pack` with the group of the snapshot; all other textures and decoders are the same objects.

    Where the group's textures are one group of `pack`, its decoder is replaced. Where they are not (the textures are
    being grouped anew), they leave theirs and get a new decoder, and unused decoders are dropped: until the training has
    ended, groups of the result are numbered differently than in the request. Raises ValueError for
    textures that `pack` does not have.
    """
    members = snapshot.members
    for index, encoded in zip(members, snapshot.textures, strict=True):
        if not 0 <= index < len(pack.textures) or pack.textures[index].pixel_hash != encoded.pixel_hash:
            raise ValueError(f"texture {index} of the snapshot, {encoded.name}, is not the one of the pack")
    groups = list(pack.grouping.groups)
    decoders = list(pack.decoders)
    own = groups[members[0]]
    if {index for index, group in enumerate(groups) if group == own} == set(members):
        decoders[own] = snapshot.decoder
    else:
        own = len(decoders)
        decoders.append(snapshot.decoder)
        for index in members:
            groups[index] = own
    used = sorted(set(groups))
    new_number = {group: number for number, group in enumerate(used)}
    groups = [new_number[group] for group in groups]
    given = dict(zip(members, snapshot.textures, strict=True))
    textures = tuple(_in_group(given.get(index, encoded), groups[index]) for index, encoded in enumerate(pack.textures))
    grouping = replace(pack.grouping, groups=tuple(groups)) if tuple(groups) != pack.grouping.groups else pack.grouping
    return replace(
        pack, grouping=grouping, textures=textures, decoders=tuple(decoders[group] for group in used), path=None
    )


def _in_group(encoded: EncodedTexture, group: int) -> EncodedTexture:
    return encoded if encoded.group == group else replace(encoded, group=group)


def ended_pack(pack: Pack, grouping: Grouping) -> Pack:
    """`pack`, in which the same textures share decoders as in `grouping`, with the numbers of `grouping`.

    Raises ValueError where other textures share one.
    """
    number = dict(zip(pack.grouping.groups, grouping.groups, strict=True))
    same = tuple(number[group] for group in pack.grouping.groups) == grouping.groups
    if not same or len(number) != len(set(number.values())):
        raise ValueError("not all groups have been trained")
    old = {new: group for group, new in number.items()}
    textures = tuple(_in_group(t, group) for t, group in zip(pack.textures, grouping.groups, strict=True))
    decoders = tuple(pack.decoders[old[new]] for new in range(grouping.group_count))
    return replace(pack, grouping=grouping, textures=textures, decoders=decoders)


def grey_pack(textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecConfig) -> Pack:
    """A pack that decodes to mid-grey, in the groups of `grouping`: shown until the first snapshots.

    Codes have their largest size, so that what comes fits into as much memory.
    """
    shapes = codec.layer_shapes
    outputs, width = shapes[-1]
    zeros = [np.zeros(shape, np.float32) for shape in shapes]
    biases = [np.zeros(shape[0], np.float32) for shape in shapes]
    grey = np.full(outputs, 0.5, np.float32)
    adapter = None
    if codec.adapters:
        own = (zeros[-1], grey) if codec.adapter_output else ()
        hidden = len(shapes) - 1
        adapter = Adapter(np.ones((hidden, width), np.float32), np.zeros((hidden, width), np.float32), *own)
    last = np.zeros_like(grey) if codec.adapter_output else grey
    decoder = Decoder(tuple(zeros), (*biases[:-1], last))
    channels = codec.latent_channels
    encoded = []
    for texture, group in zip(textures, grouping.groups, strict=True):
        cells = latent_cell_count(*texture.size, codec)
        latents = QuantizedLatents(
            np.zeros((cells, channels), np.uint8), np.ones(channels, np.float32), np.zeros(channels, np.float32)
        )
        encoded.append(encoded_texture(texture, group, latents, adapter))
    return Pack(codec, grouping, tuple(encoded), (decoder,) * grouping.group_count)


def mean_colour_pack(textures: Sequence[SourceTexture], grouping: Grouping, codec: BlockCodecConfig) -> Pack:
    """A pack in which every texel has the mean colour of some texels of its texture, in the groups of `grouping`: shown until the
    first snapshots.

    Codes have their largest size, so that what comes fits into as much memory.
    """
    channels = codec.output_channels
    decoder = BlockDecoder(
        np.zeros((codec.coefficients, codec.block_texels, channels), np.int8),
        np.zeros(codec.coefficients, np.float32),
        np.zeros((codec.modes, codec.coefficients), np.uint8),
    )
    encoded = []
    for texture, group in zip(textures, grouping.groups, strict=True):
        levels = latent_levels(*texture.size, codec)
        blocks = levels[-1].first_cell + levels[-1].cells
        mean = np.zeros(channels, np.float32)
        strides = (1 + side // MEANT_TEXELS for side in texture.pixels.shape[:2])
        sample = texture.pixels[tuple(slice(None, None, stride) for stride in strides)]
        places = channel_places(texture.maps, texture.channels, codec.maps, channels)
        mean[list(places)] = sample.mean(axis=(0, 1)) / 255.0
        empty = BlockCodes(
            np.zeros((blocks, codec.block_words[-1]), np.uint32), np.full(blocks, len(codec.block_words) - 1)
        )
        flat = BlockTexture(
            *texture.size, stored_words(empty, levels, codec), mean, np.zeros((channels, channels), np.float32)
        )
        encoded.append(encoded_block_texture(texture, group, flat, codec))
    return Pack(codec, grouping, tuple(encoded), (decoder,) * grouping.group_count)


def unchanged_groups(old: Grouping, new: Grouping) -> dict[int, int]:
    """The groups of `new` that have the same textures as a group of `old`: their numbers, and those of the old ones."""
    members = {group_members(old, group): group for group in range(old.group_count)}
    found = {group: members.get(group_members(new, group)) for group in range(new.group_count)}
    return {group: number for group, number in found.items() if number is not None}


def group_members(grouping: Grouping, group: int) -> tuple[int, ...]:
    """Indices of the textures in a group, in ascending order."""
    return tuple(index for index, number in enumerate(grouping.groups) if number == group)


def moved_texture(grouping: Grouping, texture: int, group: int) -> Grouping:
    """`grouping` with one texture in another group; `group` may be one more than there are. A group that is left empty is
    closed. Raises InputError for numbers out of range."""
    if not 0 <= texture < len(grouping.groups) or not 0 <= group <= grouping.group_count:
        raise InputError(
            f"texture {texture} to group {group}: there are {len(grouping.groups)} textures and {grouping.group_count} groups"
        )
    if grouping.name == UNIVERSAL:
        raise InputError(f"grouping {UNIVERSAL} has one decoder for all textures; group the textures anew instead")
    groups = list(grouping.groups)
    groups[texture] = group
    numbers = {old: number for number, old in enumerate(sorted(set(groups)))}
    return replace(grouping, groups=tuple(numbers[old] for old in groups))
