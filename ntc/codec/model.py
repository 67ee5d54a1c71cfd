"""The pack as data: settings of a codec, encoded textures and decoders of one grouping (docs/reference/pack-format.md)."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from ntc.codec.config import UNIVERSAL, ColorSpace, WrapMode
from ntc.codec.maps import BASE_ALONE, MapName, channel_places


class CodecSettings(ABC):
    """Shape of latents and decoders, the same for every texture of a pack. Subclasses are frozen dataclasses."""

    kind: ClassVar[str]
    """Name of the codec in `ntc.codec.registry`."""
    levels: int | None
    """Encoded mips at most. None: as many as `smallest_top_cells` asks for. 1: mip 0 alone."""
    output_channels: int
    """Channels that decoders write, 1 to 13: those of `maps`; a texture with fewer uses the first ones."""
    maps: tuple[MapName, ...]
    """Maps that the channels stand for (`ntc.codec.maps`): all that any texture of the pack has."""

    @property
    @abstractmethod
    def downscale(self) -> int:
        """Texels per latent cell along one side."""

    @property
    @abstractmethod
    def smallest_top_cells(self) -> int:
        """The pyramid ends at the first level whose longer side is at most this many cells."""

    @property
    def mips_a_cell(self) -> int:
        """Mips at most that are decoded from the same cells."""
        return 1

    @property
    @abstractmethod
    def multiply_adds(self) -> int:
        """Multiply-adds of one decoded texel at most."""


@dataclass(frozen=True, eq=False)
class EncodedTexture:
    """The facts about a texture that packs of every codec hold. Each codec adds the arrays that it decodes from."""

    name: str
    pixel_hash: str
    """Identity of the original image (`ntc.codec.textures.hash_pixels`): the scene's texture is found by it."""
    width: int
    """Encoded width in texels; smaller than the original's when the texture was reduced before encoding."""
    height: int
    """Encoded height in texels."""
    channels: int
    """Channels of the texture, 1 to 13: those of `maps`. The decoder's further outputs are unused."""
    color_space: ColorSpace
    """Space of the decoded numbers of the map `base`, in [0, 1]."""
    wrap: tuple[WrapMode, WrapMode]
    category: str | None
    group: int
    """Index of the decoder that decodes this texture."""
    psnr_db: float | None = None
    """PSNR in dB of mip 0 over 8-bit values of all channels, measured after quantisation by the encoder."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps of the texture, some of `CodecSettings.maps`; more than `base` alone: a material set."""
    map_psnr_db: tuple[float | None, ...] = ()
    """PSNR in dB of mip 0 of each of `maps` in a material set, as `psnr_db`; empty where it is not known."""
    code_mips: int | None = None
    """Mips at most that are decoded from one code, 1 or 2: fewer than the codec's settings say. None: as many as they say."""
    normal_degrees: tuple[float, float] | None = None
    """Mean and 95th percentile of the angle in degrees between decoded and original normals of a material set."""

    def places(self, config: CodecSettings) -> list[int]:
        """Return which of the decoder's outputs stands for each channel. Raises ValueError for maps that the codec lacks."""
        return list(channel_places(self.maps, self.channels, config.maps, config.output_channels))


@dataclass(frozen=True, eq=False)
class Decoder:
    """The data that the textures of a group share. Each codec has its own kind."""


@dataclass(frozen=True)
class Grouping:
    """An assignment of textures to decoders. Texture i belongs to group `groups[i]`; groups are 0 .. group_count - 1."""

    name: str
    groups: tuple[int, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Parameters by which the groups were found: JSON values only."""

    @classmethod
    def of_labels(cls, name: str, labels: Sequence[Hashable], parameters: Mapping[str, Any]) -> "Grouping":
        """Return a grouping in which textures with equal labels share a group; groups are numbered by their first texture."""
        numbers = {label: number for number, label in enumerate(dict.fromkeys(labels))}
        return cls(name, tuple(numbers[label] for label in labels), parameters)

    @property
    def group_count(self) -> int:
        """Number of groups, and so of decoders."""
        return max(self.groups, default=-1) + 1

    @property
    def stored_decoders(self) -> int:
        """Decoders that a pack holds: none where the one that ships with the program serves all textures."""
        return 0 if self.name == UNIVERSAL else self.group_count

    def members(self, group: int) -> tuple[int, ...]:
        """Return the indices of the textures in a group, in ascending order."""
        return tuple(index for index, number in enumerate(self.groups) if number == group)


@dataclass(frozen=True, eq=False)
class Pack:
    """Everything needed to decode a set of textures; immutable."""

    config: CodecSettings
    grouping: Grouping
    textures: tuple[EncodedTexture, ...]
    """All of the kind of the codec that `config` belongs to, as `decoders` are."""
    decoders: tuple[Decoder, ...]
    training: Mapping[str, Any] = field(default_factory=dict)
    """Recipe, steps, seed and library versions, for the record: JSON values only."""
    path: Path | None = None
    """The file it was read from."""

    @property
    def name(self) -> str:
        """Name of the pack in messages: its file, else its grouping."""
        return str(self.path or self.grouping.name)
