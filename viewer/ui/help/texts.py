"""Texts of tooltips and of the glossary: commands, controls, entries of lists and figures."""

from typing import Final

from ntc.codec.registry import SUMMARIES
from viewer.commands import BY_ID, NEXT
from viewer.commands.command import Command, Parameter
from viewer.commands.keys import Bindings
from viewer.state.setting import sentence


def command_text(command: Command, bound: Bindings, about: str = "") -> str:
    """Return the tooltip of a command: its help, or `about` in place of it, and its key."""
    key = bound.text(command.id)
    return (about or sentence(command.help)) + (f"\nKey: {key}" if key else "")


def control_text(command: Command, parameter: Parameter | None, bound: Bindings) -> str:
    """Return the tooltip of the widget that sets `parameter` of a command, with the key that takes the next choice."""
    is_number = parameter is not None and not parameter.is_choice
    help_text = " ".join(map(sentence, (command.help, parameter.arg.help if parameter and is_number else ""))).strip()
    return command_text(BY_ID[NEXT.get(command.id, command.id)], bound, command.about or help_text)


def value_text(value: str) -> str:
    """Return the tooltip of an entry of a list; "" for clear names and names of the scene."""
    if value in VALUES:
        return VALUES[value]
    return next((text for start, text in FORMATS.items() if value.startswith(start)), "")


def choice_text(parameter: Parameter, choice: str) -> str:
    """Return the tooltip of a choice of a command; "" for clear names and names of the scene."""
    return parameter.arg.values.get(choice) or value_text(choice)


VALUES: Final = {
    # Sources
    "reference": "The original images, filtered by the graphics hardware.",
    # Light
    "sky": "A clear sky that follows the sun.",
    # Groupings
    "baseline": "A decoder for each texture: the best quality, and the most divergence.",
    "single": "All textures share one decoder: no divergence.",
    "random": "Random groups of textures, as a baseline for comparisons.",
    "category": "Textures of one category (brick, wood, ...) share a decoder.",
    "clustered": "Textures that look alike share a decoder.",
    "covisible": "Textures that are visible in the same blocks share a decoder: the least divergence for its number of groups.",
    "universal": "Tables that ship with the program and were made without the scene. Nothing is trained, and packs hold no tables.",
    # Codecs, recipes
    **SUMMARIES,
    "best": "Training settings with the higher quality.",
    "paper": "Training settings of the publication.",
    # Exports
    "gltf": "glTF whose textures also name the pack: other programs show the originals.",
    "gltf-ktx2": "glTF with decoded images in KTX2 (Basis UASTC), and a table of what they lose.",
    "gltf-bc7": "glTF with decoded images in BC7 (DDS), and a table of what they lose.",
    "page": "A web page that shows the pack in the browser.",
    "glsl": "The decoder's source in GLSL, with its data.",
    "hlsl": "The decoder's source in HLSL, with its data.",
    "wgsl": "The decoder's source in WGSL, with its data.",
    "cuda": "The decoder's source in CUDA, with its data.",
    # Sides, pictures
    "a": "Slot A.",
    "b": "Slot B.",
    "shown": "The picture as shown.",
    "split": "Both slots with the divider.",
    "plain": "The picture without a map over it.",
    "on": "Switched on.",
    "off": "Switched off.",
}
"""Tooltips of values, by the text that commands take."""

FORMATS: Final = {
    "bc1": "BC1: a block format of graphics hardware, 4 bits per texel.",
    "bc7": "BC7: a block format of graphics hardware, 8 bits per texel.",
    "astc-": "ASTC: a block format of graphics hardware, 128 bits for each block of this many texels.",
    "run ": "Pack of this training run. Keep the run to write it to a file.",
}
"""Tooltips of values, by the beginning of the text."""

TERMS: Final = {
    "A, B": "The two slots of the comparison. Each shows the original images, a block format, or a pack.",
    "adapter": "A few numbers of one texture that adjust the decoder it shares with others.",
    "anisotropy": "Most samples that the hardware filter takes of a texture, so that surfaces at a slant stay sharp.",
    "BC1, BC7, ASTC": "Block formats that graphics hardware reads directly: 4 bits, 8 bits, or 0.9 to 8 bits per texel.",
    "bits per texel": "Size of the stored texture divided by the texels of mip 0. Uncompressed RGBA with mips has 43.",
    "block (codec)": "Latents for blocks of 4x4 or 8x8 texels. They are computed in closed form, so that encoding takes seconds.",
    "block (of the map)": "Pixels that the GPU shades together: 8x8, or another shape of the panel Divergence.",
    "codec": "How latents become texels: block or grid.",
    "decode path": "Where and when texels are decoded: forward, deferred, binned, cached or on-load. Paths differ in speed.",
    "decoder": "A small neural network that turns latents into texels. The textures of a group share one.",
    "divergence": "Pixels of one block need different decoders: the GPU has to run all of them, one after the other.",
    "divergence map": "D of each block: the number of different decoders that its pixels need. 0 where nothing is decoded.",
    "excess": "Sum over all blocks of their decoders beyond the first: 0 means no divergence.",
    "FLIP": "Difference that an eye sees when it flips between two pictures: 0 is equal, 1 is the largest.",
    "grid (codec)": "The published method: a grid of latents that is trained step by step together with its decoder.",
    "group": "Textures that share one decoder.",
    "grouping": "Rule that puts textures into groups: baseline, single, random, category, clustered, covisible or universal.",
    "latents": "Numbers that are stored for a texture instead of its texels.",
    "learning rate of the decoders": "Scale of the decoders' learning rate: 100 % is the full rate, at 0 % they are fixed.",
    "level of detail, lod": "Mip that a pixel reads: 0 is the full size, each further level halves it.",
    "loss": "Weighted error that training minimises.",
    "material set": "Maps of one material that are encoded together: base colour, normal, roughness and so on.",
    "mip": "Copy of a texture at half the size of the previous mip, read for distant surfaces. Mip 0 is the largest.",
    "pack": "A .ntc file: the encoded textures and the decoders of one grouping of a scene.",
    "precision": "Number format of decoders on the GPU: fp32 (32 bits) or fp16 (16 bits).",
    "PSNR": "Peak signal-to-noise ratio in dB: higher is better. Above 40 dB a difference is hard to see, below 30 dB it is plain.",
    "recipe": "Settings of the training: best for quality, paper as published.",
    "reference": "The original images, filtered by the graphics hardware.",
    "run": "One training, from its start to its end. Keep it to write its pack beside the scene.",
    "score": "Excess divided by the number of blocks: the mean number of decoders beyond the first.",
    "slot": "One of the two sides of the comparison, A or B.",
    "SSIM": "Structural similarity of two pictures, at most 1: 1 is equal.",
    "texel": "A pixel of a texture.",
    "tile": "Square part of a texture that path cached decodes once and stores.",
    "wave": "Pixels that a GPU shades together, 32 or 64 of them. If they need several decoders, all pixels wait for each.",
    "wave efficiency": "Share of decoder runs that would remain without divergence: 100 % is best.",
}
"""Meanings by term, in alphabetical order."""

MAPS_OF_FIGURES: Final = ("base", "normal", "roughness", "metalness", "emissive", "occlusion")
FIGURES: Final = {
    **{name: TERMS[name] for name in ("PSNR", "SSIM", "FLIP", "bits per texel", "score", "excess", "wave efficiency")},
    **{
        f"{name} alone dB": f"PSNR in dB with only the {name} map decoded and all other maps original: higher is better."
        for name in MAPS_OF_FIGURES
    },
    **{
        f"column {name} dB": f"PSNR of mip 0 of the {name} map in dB: higher is better. Click to sort."
        for name in MAPS_OF_FIGURES
    },
    "menu: File": "Open files, save the view, take pictures.",
    "menu: Edit": "Undo and redo; copy and paste the view.",
    "menu: View": "View of the materials, resolution, filters and light.",
    "menu: Camera": "Place and motion of the camera.",
    "menu: Compare": "What slots A and B show, and how the picture compares them.",
    "menu: Inspect": "Pixels, errors and single textures.",
    "menu: Overlay": "Maps over the picture.",
    "menu: Train": "Encode the scene, or continue training its pack while you look.",
    "menu: Window": "Panels and their appearance.",
    "menu: Help": "Keys, terms and commands.",
    "shows": "Source that the slot shows: the original images, a block format or a pack.",
    "PSNR seen dB": "PSNR of the picture against one of the original images in dB, over the pixels that show the scene: "
    "higher is better.",
    "file MB": "Size of the pack's latents and decoders in MB; of a block format, of its blocks.",
    "GPU MB": "Memory of this slot on the GPU in MB: resident latents, decoders and tables; of originals, RGBA8 with all mips.",
    "decode ms": "Median time of drawing this slot at rest, in ms: decoding and light.",
    "path": "Decode path of the slot. For auto, the path that it has chosen.",
    "divergence score": "Excess divided by the number of blocks: 0 is best.",
    "compression dB": "PSNR in dB of the compressed texels of path on-load against the decoded ones, all mips: higher is better.",
    "load Mtexel/s": "Speed of path on-load: texels decoded and compressed in a second, all mips and maps, in millions.",
    "SSIMULACRA2": "Perceptual quality of the picture: 100 is equal, 90 is hard to tell apart, 50 is plain to see.",
    "JOD": "Quality that ColorVideoVDP predicts, in just-objectionable differences: 10 is equal, each step below is plainer.",
    "divergent blocks": "Number of blocks whose pixels need more than one decoder.",
    "decoders per block": "Mean number of decoders in a block that shows the scene.",
    "at most": "Largest number of decoders in a block.",
    "% of blocks": "Share of the blocks with this number of decoders, in per cent.",
    "% with so many or fewer": "Share of the blocks with at most this number of decoders, in per cent.",
    "column error %": "Share of this texture in the squared error of the picture, A against B, in per cent.",
    "column A": "Figures of slot A.",
    "column B": "Figures of slot B.",
    "column figure": "Name of the figure. Point at it to see its meaning.",
    "column picture": "Thumbnail of the texture.",
    "column name": "Name of the texture's image. Click to sort.",
    "column size": "Width x height of the original, in texels. Click to sort.",
    "column category": "Category of the texture, as its name suggests. Click to sort.",
    "column group": "Number of the group: textures of one group share a decoder. Click to sort.",
    "column bits": "Bits of latents, all mips, per texel of mip 0 as encoded, without tables of decoders. Click to sort.",
    "column kB": "Latents of this texture in the file, in kilobytes. Click to sort.",
    "column normals": "Mean angle in degrees between decoded and original normals: lower is better. Click to sort.",
    "column on GPU": "Latents of this texture on the GPU now, in kilobytes. Click to sort.",
    "column members": "Number of textures in the group. Click to sort.",
    "column mip 0 dB": "PSNR in dB of mip 0, the largest, against the original, as measured when it was encoded: higher is "
    "better. For a group it is of the mean square error of its textures. Click to sort.",
    "column worst dB": "Lowest PSNR of mip 0 of the group's textures in dB. Click to sort.",
    "column run": "Number of the training run.",
    "column what": "Job of the run. Point at a line for details.",
    "column dB": "PSNR in dB of the mean square error of mip 0 of all textures: higher is better. A run that ended early "
    "has that of samples of all mips. Point at a line to see which of the two it is.",
    "column time": "Training time.",
    "column into": "Show the pack of the run in slot A or B.",
    "pixel material": "Material of the surface.",
    "pixel texture": "Number and name of the texture that the pixel reads.",
    "pixel uv": "Texture coordinates of the pixel: 0 to 1 is once across the texture.",
    "pixel lod": "Level of detail: 0 is the texture at full size, each further level halves it.",
    "pixel decoder": "Number of the decoder in A and B. Textures of a group share one.",
    "honoured": "Features of the file that are drawn as specified.",
    "ignored": "Features of the file that have no effect.",
    "missing": "Files or parts of the scene that cannot be read, and what is used instead.",
    "repaired": "Broken values of the file, such as normals without a direction, and what is used instead.",
    "notes": "Other remarks about the file.",
    "pixel D": "Number of decoders that the pixel's block needs, in A and B.",
}
"""Tooltips of menus, and of figures, columns and parts whose names come from data."""
