"""Fitting the tables that ship for whole materials: samples with maps mixed and gains varied, then modes by Lloyd's iteration."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Sample, prepare_texture
from ntc.codec.block.encoding.gains import band_energies, steps_between
from ntc.codec.block.encoding.quantizer import expected_errors
from ntc.codec.block.encoding.tables import first_classes
from ntc.codec.block.encoding.transform import Basis, one_thread, projected, strongest_rows
from ntc.codec.block.model import stored_scales
from ntc.codec.block.trellis import EXPECTED_ERROR, SCALE_STEPS_PER_OCTAVE, scale_values
from ntc.codec.block.universal import BANDS, SET_MODES
from ntc.codec.maps import LARGEST_CHANNELS, MAP_CHANNELS, MAPS, MapName, map_slices
from ntc.codec.mips import resize_to
from ntc.codec.textures import SourceTexture, hash_pixels
from viewer.scene.images import read_image, split_alpha
from viewer.scene.load import load_scene
from viewer.scene.source_textures import reduce_texture, source_textures

Image = NDArray[np.uint8]
SET_CHANNELS = LARGEST_CHANNELS - MAP_CHANNELS["alpha"]
"""Channels of all MAPS, with a base of four: the map `alpha` takes the rows of its last one."""
SIDE = 128
"""Texels of a sample along one side."""
SIDES = (1024, 512, 256)
"""Materials are sampled at these sizes: reduced ones have sharper blocks."""
SAMPLES, BLOCKS_PER_SAMPLE = 1000, 120
ROWS_PER_CHANNEL = 52
"""Rows of the basis for each channel, on average."""
FIRST_ROWS = (0, 1, 4, 12, 30)
"""Of a channel's rows by falling energy: the first of each band."""
WORDS_OF_ROUNDS = (7, 4, 10, 7)
"""Words of a code in which blocks choose their modes, by round."""
PRESENT = 1e-6
"""Least mean energy of a band, in blocks of normalised values, whose shape counts."""
LINEAR_MAPS: tuple[MapName, ...] = ("roughness", "metalness", "occlusion")


@dataclass(frozen=True, eq=False)
class Material:
    """A material's maps at several sizes."""

    name: str
    sizes: tuple[dict[MapName, Image], ...]


def _material(texture: SourceTexture) -> Material:
    sizes = [reduce_texture(texture, side) for side in SIDES if side == SIDES[0] or max(texture.size) > side]
    maps = [map_slices(each.maps, each.channels) for each in sizes]
    return Material(
        texture.name,
        tuple({n: each.pixels[..., p] for n, p in own.items()} for each, own in zip(sizes, maps, strict=True)),
    )


def folder_material(folder: Path) -> SourceTexture | None:
    """The material in a folder of images that are named like maps (base.jpg, normal.png, ...), at the size of the smallest of them;
    None without base."""
    maps: list[MapName] = []
    parts: list[Image] = []
    for name in MAPS:
        found = sorted(folder.glob(f"{name}.*"))
        if found:
            colour, _ = split_alpha(read_image(found[0]))
            maps.append(name)
            parts.append(colour[..., : MAP_CHANNELS[name]])
    if "base" not in maps:
        return None
    height, width = min(part.shape[:2] for part in parts)
    sized = [resize_to(part, width, height, "srgb", (name,)) for name, part in zip(maps, parts, strict=True)]
    pixels = np.ascontiguousarray(np.concatenate(sized, axis=2))
    return SourceTexture(folder.name, pixels, hash_pixels(pixels), maps=tuple(maps))


def read_materials(places: Sequence[Path]) -> tuple[SourceTexture, ...]:
    """Whole materials of scenes, and of folders that hold a folder for each material (`folder_material`)."""
    found: dict[str, SourceTexture] = {}
    for place in places:
        if place.is_file():
            own = [reduce_texture(each, SIDES[0]) for each in source_textures(load_scene(place), None, "all")]
        else:
            each_folder = [folder_material(folder) for folder in sorted(place.iterdir()) if folder.is_dir()]
            own = [reduce_texture(each, SIDES[0]) for each in each_folder if each is not None]
        # Several scenes may show one material.
        found |= {each.pixel_hash: each for each in own if len(each.maps) > 1}
    return tuple(found.values())


class Sampler:
    """Draws materials whose maps vary by themselves: maps of different materials, turned, with other contrasts; parts of several
    materials beside each other, as atlases have; parts that are flat."""

    def __init__(self, materials: Sequence[Material], seed: int) -> None:
        self._materials = materials
        self._random = np.random.default_rng(seed)

    def draw(self) -> SourceTexture:
        """A texture of all maps."""
        random = self._random
        pixels = self._collage() if random.random() < 0.5 else self._whole()
        if random.random() < 0.8:
            pixels[..., self._places("emissive")] = 0
        elif random.random() < 0.7:
            lit = self._mask(0.8 + 0.15 * random.random())
            shown = pixels[..., self._places("emissive")].astype(np.float32) * lit[..., None]
            pixels[..., self._places("emissive")] = shown.astype(np.uint8)
        alpha = np.full((SIDE, SIDE), 255) if random.random() < 0.8 else 255.0 * self._mask(random.random())
        pixels[..., 3] = alpha.astype(np.uint8)
        return SourceTexture("sample", np.ascontiguousarray(pixels), "0", maps=MAPS)

    @staticmethod
    def _places(name: MapName) -> slice:
        return map_slices(MAPS, SET_CHANNELS)[name]

    def _some(self) -> Material:
        return self._materials[int(self._random.integers(len(self._materials)))]

    def _crop(self, image: Image, place: tuple[float, float]) -> Image:
        """SIDE x SIDE texels at `place` (0 to 1) of an image, which repeats."""
        rows = (np.arange(SIDE) + int(place[0] * max(1, image.shape[0] - SIDE + 1))) % image.shape[0]
        columns = (np.arange(SIDE) + int(place[1] * max(1, image.shape[1] - SIDE + 1))) % image.shape[1]
        return image[rows][:, columns]

    def _place(self) -> tuple[float, float]:
        return float(self._random.random()), float(self._random.random())

    def _map(self, name: MapName) -> Image | None:
        """A map of this kind from any material, turned."""
        random = self._random
        for _ in range(6):
            kind = LINEAR_MAPS[int(random.integers(3))] if name in LINEAR_MAPS and random.random() < 0.3 else name
            sizes = self._some().sizes
            found = sizes[int(random.integers(len(sizes)))].get("base" if kind == "emissive" else kind)
            if found is not None:
                return self._turned(self._crop(found, self._place()), name)
        return None

    def _turned(self, image: Image, name: MapName) -> Image:
        quarter, flip = int(self._random.integers(4)), self._random.random() < 0.5
        found = np.rot90(image, quarter)
        if name == "normal" and quarter % 2:
            # Statistics alone count: for them an axis and its opposite are the same.
            found = found[..., ::-1]
        return found[:, ::-1] if flip else found

    def _gained(self, image: Image) -> Image:
        gain = 2.0 ** self._random.uniform(-1.0, 1.0)
        mean = image.mean((0, 1))
        return np.clip((image - mean) * gain + mean + 0.5, 0, 255).astype(np.uint8)

    def _whole(self, of: Material | None = None, mixed: bool | None = None) -> Image:
        """[SIDE, SIDE, SET_CHANNELS] of one material, or its maps with those of others."""
        random, material = self._random, of or self._some()
        size, place = material.sizes[int(random.integers(len(material.sizes)))], self._place()
        mixed = random.random() < 0.5 if mixed is None else mixed
        found = np.zeros((SIDE, SIDE, SET_CHANNELS), np.uint8)
        for name in MAPS:
            own = size.get(name)
            image: Image | None = None
            if own is not None and (not mixed or name == "base" or random.random() < 0.3):
                image = self._crop(own, place)
                image = self._turned(image, name) if mixed else image
            elif (mixed and random.random() < 0.8) or name == "emissive" or random.random() < 0.2:
                image = self._map(name)
            if image is not None:
                slot = self._places(name)
                image = self._gained(image) if random.random() < 0.7 else image
                found[..., slot.start : slot.start + image.shape[2]] = image[..., : slot.stop - slot.start]
        return found

    def _collage(self) -> Image:
        random = self._random
        one = self._some() if random.random() < 0.5 else None
        parts, labels = [], self._labels(int(random.integers(1, 5)))
        shifted = np.zeros(SET_CHANNELS)
        for name in ("base", "roughness", "metalness", "occlusion"):
            shifted[self._places(name)] = 25.0
        for _ in range(labels.max() + 1):
            part = self._whole(one) + random.normal(0.0, 1.0, SET_CHANNELS) * shifted
            flat = np.zeros(SET_CHANNELS, bool)
            kind = random.random()
            for name in MAPS if kind < 0.4 else ():
                # Some parts are flat in all maps, some in a few.
                flat[self._places(name)] = kind < 0.15 or random.random() < 0.4
            part[..., flat] = part[..., flat].mean((0, 1), keepdims=True)
            if random.random() < 0.3:
                part[..., self._places("metalness")] = random.choice([0.0, 255.0])
            parts.append(np.clip(part, 0, 255))
        joined = np.take_along_axis(np.stack(parts), labels[None, ..., None], axis=0)[0]
        return joined.astype(np.uint8)

    def _labels(self, count: int) -> NDArray[np.int64]:
        """[SIDE, SIDE] number of the part that each texel shows: half planes, rectangles and ellipses, one over the other."""
        random, (y, x) = self._random, np.mgrid[0:SIDE, 0:SIDE]
        labels = np.zeros((SIDE, SIDE), np.int64)
        for number in range(1, count + 1):
            kind = random.random()
            angle = random.random() * 2 * np.pi if kind < 0.4 else int(random.integers(4)) * np.pi / 2
            (cx, cy), (a, b) = random.uniform(0, SIDE, 2), random.uniform(6, SIDE / 2, 2)
            u = (x - cx) * np.cos(angle) + (y - cy) * np.sin(angle)
            v = (y - cy) * np.cos(angle) - (x - cx) * np.sin(angle)
            shape = (
                (u > 0)
                if kind < 0.3
                else (abs(u) < a) & (abs(v) < b)
                if kind < 0.8
                else (u / a) ** 2 + (v / b) ** 2 < 1
            )
            labels[shape] = number
        return labels

    def _mask(self, share: float) -> NDArray[np.float64]:
        """[SIDE, SIDE] 0 to 1: 1 where some material is bright, with soft edges."""
        image = self._map("base")
        grey = np.zeros((SIDE, SIDE)) if image is None else image.mean(2)
        return np.asarray(np.clip((grey - np.quantile(grey, share)) / 16.0 + 0.5, 0.0, 1.0))


def drawn_samples(materials: Sequence[SourceTexture], count: int = SAMPLES, seed: int = 0) -> list[Sample]:
    """Samples of textures that `Sampler` draws from `materials`."""
    sampler, random = Sampler([_material(each) for each in materials], seed), np.random.default_rng(seed)
    found = []
    for _ in range(count):
        texture = prepare_texture(sampler.draw(), FULL_CONFIG)
        chosen = random.permutation(len(texture.texels))[:BLOCKS_PER_SAMPLE]
        found.append(Sample(texture.normalised(chosen), texture.axes, len(texture.texels)))
    return found


FULL_CONFIG = BlockConfig(
    coefficients=ROWS_PER_CHANNEL * SET_CHANNELS,
    modes=SET_MODES,
    output_channels=SET_CHANNELS,
    maps=MAPS,
)


def _cosines() -> NDArray[np.float64]:
    """[texels, texels]: rows of the cosine transform of a block (DCT-II), of length 1. JPEG has left most texture files few of them."""
    side = FULL_CONFIG.block_side
    steps = np.arange(side)
    lines = np.cos(np.pi * (2 * steps[None] + 1) * steps[:, None] / (2 * side))
    lines /= np.linalg.norm(lines, axis=1, keepdims=True)
    return np.einsum("ai,bj->abij", lines, lines).reshape(side * side, side * side)


def _full_basis(samples: Sequence[Sample]) -> tuple[Basis, NDArray[np.float64]]:
    """(the basis, [rows] mean energies): the rows of most energy, whichever their channel."""
    images = [torch.from_numpy(sample.blocks).view(-1, FULL_CONFIG.block_texels, SET_CHANNELS) for sample in samples]
    cosines = _cosines()
    matrix = torch.from_numpy(cosines.astype(np.float32))
    means = [torch.einsum("kt,ntc->nkc", matrix, own).square().mean(0).T.numpy().astype(np.float64) for own in images]
    # Channels that few samples have count as much as others.
    present = np.mean([own.sum(1) > PRESENT * FULL_CONFIG.block_texels for own in means], axis=0)
    energies = np.mean(means, axis=0) / np.maximum(present, 1.0 / len(samples))[:, None]
    return strongest_rows(np.tile(cosines, (SET_CHANNELS, 1)), energies.reshape(-1), FULL_CONFIG)


def _bands(basis: Basis, energies: NDArray[np.float64]) -> NDArray[np.int64]:
    """[rows] band of each row within its channel."""
    bands = np.zeros(len(energies), np.int64)
    for channel in range(SET_CHANNELS):
        own = np.nonzero(basis.channels == channel)[0]
        order = own[np.argsort(-energies[own], kind="stable")]
        bands[order] = np.searchsorted(FIRST_ROWS, np.arange(len(own)), side="right") - 1
    return bands


def fitted_set_tables(samples: Sequence[Sample], seed: int = 0) -> dict[str, np.ndarray]:
    """The tensors of the file of `ntc.codec.block.universal.set_tables_path`."""
    with one_thread():
        basis, rows = _full_basis(samples)
        within = _bands(basis, rows)
        bands, count = basis.channels.astype(np.int64) * BANDS + within, SET_CHANNELS * BANDS
        reference = band_energies(rows, bands, count)
        projections = basis.projections(FULL_CONFIG)
        coefficients = [torch.from_numpy(projected(sample.blocks, projections)) for sample in samples]
        fit = _ModeFit(coefficients, bands, reference, rows, seed)
        return {
            "basis": basis.rows,
            "channels": basis.channels,
            "basis_scale": basis.scale,
            "scales": fit.scales(),
            "edges": np.zeros((SET_MODES, len(FULL_CONFIG.planes)), np.uint8),
            "bands": within.astype(np.uint8),
            "energies": reference.astype(np.float32),
        }


class _ModeFit:
    """Modes where every band of every sample has the reference's energy; which mode a block takes is decided with its sample's own
    gains."""

    def __init__(
        self,
        coefficients: Sequence[torch.Tensor],
        bands: NDArray[np.int64],
        reference: NDArray[np.float64],
        rows: NDArray[np.float64],
        seed: int,
    ) -> None:
        self._coefficients, self._bands, self._rows = coefficients, bands, rows
        self._random = np.random.default_rng(seed)
        means = [own.square().mean(0).numpy().astype(np.float64) for own in coefficients]
        energies = [band_energies(mean, bands, len(reference)) for mean in means]
        self._gains = [np.rint(steps_between(each, reference)).clip(-128, 127) for each in energies]
        flat = [torch.from_numpy(2.0 ** (-own.astype(np.float64)[bands] / 8.0)).float() for own in self._gains]
        self._squares = torch.cat([own.square() * by for own, by in zip(coefficients, flat, strict=True)])
        self._owner = torch.from_numpy(np.repeat(np.arange(len(coefficients)), [len(own) for own in coefficients]))
        present = torch.from_numpy(np.array([each > PRESENT for each in energies]))
        self._present = present[:, torch.from_numpy(bands)].float()
        self._weights = torch.ones(len(self._squares))
        self._importance = np.mean(energies, axis=0)

    def scales(self) -> NDArray[np.uint8]:
        """[modes, rows] stored scales."""
        chosen = self._first()
        scales = self._fitted(chosen)
        for words in WORDS_OF_ROUNDS:
            chosen = self._chosen(scales, 32 * words - FULL_CONFIG.mode_bits)
            scales = self._fitted(chosen)
        return scales

    def _first(self) -> torch.Tensor:
        features = torch.zeros(len(self._squares), len(self._importance))
        energies = torch.from_numpy(self._rows)
        for band in range(len(self._importance)):
            own = torch.from_numpy(np.nonzero(self._bands == band)[0])
            if len(own):
                level = torch.log(self._squares[:, own].sum(1) / energies[own].sum().float() + 3e-3)
                features[:, band] = level * self._present[self._owner][:, own[0]]
        weight = (self._importance / self._importance.max()) ** 0.25
        return torch.from_numpy(
            first_classes((features * torch.from_numpy(weight).float()).numpy(), SET_MODES, self._random)
        )

    def _fitted(self, chosen: torch.Tensor) -> NDArray[np.uint8]:
        """Scales of the blocks that chose each mode; samples without a band say nothing about its rows."""
        members = torch.zeros(SET_MODES, len(chosen))
        members[chosen, torch.arange(len(chosen))] = self._weights
        # Sums by mode and sample, then by row: a row counts the samples that have it.
        known = torch.zeros(SET_MODES, len(self._coefficients)).index_add_(1, self._owner, members)
        weights = known @ self._present
        shown = self._squares * self._present[self._owner]
        mean = (self._weights @ shown) / (self._weights @ self._present[self._owner]).clamp(min=1e-9)
        prior = 1.0
        variance = (members @ shown + prior * mean) / (weights + prior)
        return stored_scales(np.sqrt(np.maximum(variance.double().numpy(), 1e-9)))

    def _chosen(self, scales: NDArray[np.uint8], bits: int) -> torch.Tensor:
        chosen, errors = [], []
        for own, gains in zip(self._coefficients, self._gains, strict=True):
            scaled = np.clip(scales.astype(np.int64) + gains.astype(np.int64)[self._bands], 0, 255).astype(np.uint8)
            depths = _about_shared_bits(scaled, bits)
            errors_of = expected_errors(own.numpy(), depths[None], scale_values(scaled).astype(np.float32))
            expected = torch.from_numpy(errors_of)[:, 0].min(1)
            chosen.append(expected.indices)
            errors.append(expected.values.mean())
        # An error counts more in a texture that has few: the mean PSNR is to be greatest.
        each = torch.stack(errors)
        weights = (1.0 / (each + 0.05 * each.mean()))[self._owner]
        self._weights = weights / weights.mean()
        print(f"  {bits} bits: {float(10.0 * each.log10().mean()):.3f} dB", flush=True)
        return torch.cat(chosen)


def _about_shared_bits(scales: NDArray[np.uint8], bits: int) -> NDArray[np.int64]:
    """[modes, rows] about `ntc.codec.block.trellis.share_out_bits` of each row of `scales`, in a fifth of the time."""
    gains = SCALE_STEPS_PER_OCTAVE * np.log2(-np.diff(np.asarray(EXPECTED_ERROR)))
    keys = (2.0 * scales[..., None] + gains).astype(np.float32)
    flat = keys.reshape(len(scales), -1)
    least = np.partition(flat, flat.shape[1] - bits, axis=1)[:, -bits]
    return (keys >= least[:, None, None]).sum(2).astype(np.int64)
