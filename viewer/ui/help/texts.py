"""Tooltips by label: controls, figures, commands, and entries of lists."""

import re
from typing import Final

from ntc.codec.maps import MAPS
from ntc.codec.registry import SUMMARIES
from viewer.commands import BY_ID, NEXT
from viewer.commands.command import Command, Parameter
from viewer.commands.keys import Bindings
from viewer.state.setting import sentence


def command_text(command: Command, bound: Bindings, about: str = "") -> str:
    """Return the help of a command, or what `about` says in its place, with its key."""
    key = bound.text(command.id)
    return (about or sentence(command.help)) + (f"\nKey: {key}" if key else "")


def control_text(command: Command, parameter: Parameter | None, bound: Bindings) -> str:
    """Return the explanation of a command's widget, which sets `parameter`; the key is that of the next choice, if any."""
    is_number = parameter is not None and not parameter.is_choice
    help_text = " ".join(map(sentence, (command.help, parameter.arg.help if parameter and is_number else ""))).strip()
    return command_text(BY_ID[NEXT.get(command.id, command.id)], bound, command.about or help_text)


def value_text(value: str) -> str:
    """Return the explanation of an entry of a list; "" for names that explain themselves and names of the scene."""
    if value in VALUES:
        return VALUES[value]
    return next((text for start, text in FORMATS.items() if value.startswith(start)), "")


def choice_text(parameter: Parameter, choice: str) -> str:
    """Return the explanation of a choice of a command; "" for names that explain themselves and names of the scene."""
    return parameter.arg.values.get(choice) or value_text(choice)


def explanation(label: str) -> str:
    """Return the explanation of a label; "" for none.

    A number in a label counts as `#`, a leading `A` or `B` as `slot`. Other labels take the explanation of their first words.
    """
    for name in (label, re.sub(r"\d+", "#", label), re.sub("^[AB] ", "slot ", label)):
        if text := _own(name):
            return text
    list_label, colon, value = label.partition(": ")
    if colon:
        return value_text(value) or explanation(list_label)
    words = label.split(" ")
    return next((found for end in range(len(words) - 1, 0, -1) if (found := _own(" ".join(words[:end])))), "")


def _own(label: str) -> str:
    return CONTROLS.get(label) or TERMS.get(label, "")


CONTROLS: Final = {
    # Panels
    "Compare": "What slots A and B show, how the picture compares them, and the figures of both.",
    "Timings": "Time of each step of drawing in milliseconds, over the last 300 frames.",
    "Light": "View of the materials, and the light of the scene.",
    "Memory": "Bytes of the original textures, and of what slots A and B show.",
    "Scene": "The open file: cameras, nodes, materials, and what is missing or ignored.",
    "Textures": "All textures of the scene, with their figures in slot A's pack.",
    "Groups": "Groups of slot A's pack: the textures that share one decoder.",
    "Training": "Encode the scene, or continue training its pack while you look.",
    "Divergence": "Number of different decoders in each block of pixels: the map, its colours and its figures.",
    "Pixel": "Pixels around the mouse, enlarged, with their values in A and B.",
    "Log": "All messages of this session with their times.",
    "Errors": "Textures or decoders by the difference between A and B, worst first.",
    "Histogram": "Number of pixels by the difference between A and B.",
    # Compare
    "slot encoding": "The textures are being encoded in this format. The slot shows it when all are done.",
    "divider": "A is left of the divider or above it. Drag the divider; a double-click centres it.",
    "figures state": "Which picture the figures below belong to, or why there are none.",
    # Divergence
    **dict.fromkeys(("release", "let the pixel go"), "Follow the mouse again."),
    "block texture #": "A texture in this block, with its pixels and its decoder in A and B.",
    # Errors
    "errors by texture": "One row for each visible texture.",
    "errors by decoder": "One row for each visible decoder, with all its textures.",
    "errors in the picture": "Colour every pixel by the error of its texture or decoder.",
    "error texture #": "Click: dim everything except this texture. Click again: show everything.",
    "error decoder #": "Click: dim everything except this decoder's textures. Click again: show everything.",
    "end highlight": "Show everything undimmed again.",
    # Groups, Textures
    "group #": "Click: list the members of this group below.",
    "member #": "A texture of the group. Click selects it in all panels; double-click opens the flat view. The bar is its distance "
    "from the group's centroid, in features.",
    "Train group": "Continue training this group alone; all others stay unchanged.",
    "texture filter": "Shows textures whose name or category has all these words; group:3 shows those of a group.",
    "texture #": "Click selects the texture in all panels; double-click opens the flat view.",
    "texture": "Texture to move.",
    # Scene
    "scene filter": "Shows nodes and materials whose names have all these words.",
    "animations": "Time line of the scene's animations.",
    "time": "Time in the animation, in seconds from its beginning.",
    "nodes": "Nodes of the file, with the meshes that they place.",
    "materials": "Materials of the file, each with its texture.",
    "node #": "Click expands or collapses the node.",
    "instance #": "A mesh of this node. Click selects its texture in all panels.",
    "material #": "Click selects the material's texture in all panels; double-click opens its flat view.",
    "folder": "The folder that is listed.",
    "Open file": "Open what is typed or selected; Enter does the same.",
    "Cancel opening": "Close the dialog; Escape does the same.",
    "System dialog...": "Choose the file in the desktop's own dialog.",
    "Got it": "Close the card for good; Help > First steps shows it again.",
    "first step": "One of three things to try in the first minute.",
    "load report": "What of the file is shown, ignored, missing or repaired.",
    "copy report": "Copy the whole report to the clipboard.",
    "cameras": "Cameras of the file. Keys 1 to 9 go to the first nine.",
    "camera": "Go to this camera of the scene. Keys 1 to 9 go to the first nine.",
    # Timings, Memory
    "copy timings": "Copy all figures of this panel to the clipboard.",
    "copy memory": "Copy the table to the clipboard.",
    # Training
    "run # into": "Show the pack of this run in this slot.",
    "Show unsaved run": "Show the pack of the last run of this scene that was neither kept nor discarded.",
    "Not now": "Close this card. The panel Training offers the same.",
    "tab Retrain": "Continue training chosen groups of the pack.",
    "tab Move": "Move a texture into another group.",
    "tab Regroup": "Make new groups, and train those that changed.",
    "tab Encode": "Encode the scene into a new pack.",
    "which textures": "Textures to encode: open the list to leave some out.",
    "forecast": "What this choice gives: file size, PSNR of all textures, and the time. Parts of the largest textures were encoded to "
    "know that; the result differs a little.",
    "form problem": "A value above is wrong.",
    "Show the panel Textures": "Bring the panel Textures to the front.",
    "tab Bits": "Encode single textures with more or fewer bits.",
    "copy figures": "Copy the figures to the clipboard, as a table in Markdown.",
    "save figures": "Save the figures as JSON, with the picture and a chart of the costs as PNGs.",
    "keep run #": "Write the pack of this run beside the scene; for a built-in scene into the user's data folder.",
    "discard run #": "Delete the pack of this run. Until the window closes, Keep still writes it.",
    "all groups": "Choose all groups.",
    "no groups": "Choose no group.",
    "Choose groups to retrain": "Tick one group or more in the list above.",
    "to group": "Group that the texture joins; new makes a group of its own.",
    "curves of the last run": "Loss and PSNR over the last run.",
    "curve of": "Texture whose PSNR is drawn in blue.",
    # The flat texture
    "flat texture": "One texture without the scene: its original, and the result of packs and block formats.",
    "flat A": "Source of the first side.",
    "flat B": "Source of the second side.",
    "flat caption": "Source of this side, and its PSNR in dB against the original.",
    "flat side by side": "Both sides in full, one beside the other.",
    "flat wipe": "One picture with a divider: A left of it, B right of it.",
    "flat fit": "Fit the whole texture into the window again.",
    "flat picture": "Wheel: zoom. Drag: move.",
    # Log
    "copy log": "Copy all messages to the clipboard.",
    "copy log #": "Copy this message with its details to the clipboard.",
    "errors only": "Show only errors.",
    "log #": "A message with its time. A click shows the details of a line that begins with +.",
    # Windows over the picture
    "search keys": "Shows only lines with this text.",
    "keys": "All keys and mouse gestures.",
    "search glossary": "Shows only terms whose line has this text.",
    "glossary": "Terms of this program.",
    "status": "Work in the background, and the last message.",
    "hints": "The keys that are needed first.",
    "warning #": "The picture may mislead. Point at the warning to see what to do.",
    # Menus
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
    # Figures
    "live table": "A against B over the pixels that show the scene, in 8-bit sRGB.",
    "SSIMULACRA2": "Perceptual quality of the picture: 100 is equal, 90 is hard to tell apart, 50 is plain to see.",
    "JOD": "Quality that ColorVideoVDP predicts, in just-objectionable differences: 10 is equal, each step below is plainer.",
    "PSNR seen dB": "PSNR of the picture against one of the original images in dB, over the pixels that show the scene: higher is "
    "better.",
    "costs": "Costs of each source beside the largest. PSNR of A and B is of the picture, of other formats of textures.",
    "divergence score": "Excess divided by the number of blocks: 0 is best.",
    "column error %": "Share of this texture in the squared error of the picture, A against B, in per cent.",
    "GPU MB": "Memory of this slot on the GPU in MB: resident latents, decoders and tables; of originals, RGBA8 with all mips.",
    "decode ms": "Median time of drawing this slot at rest, in ms: decoding and light.",
    "compression dB": "PSNR in dB of the compressed texels of path on-load against the decoded ones, all mips: higher is better.",
    "load Mtexel/s": "Speed of path on-load: texels decoded and compressed in a second, all mips and maps, in millions.",
    "file MB": "Size of the pack's latents and decoders in MB; of a block format, of its blocks.",
    "shows": "Source of the slot.",
    "divergent blocks": "Number of blocks whose pixels need more than one decoder.",
    "decoders per block": "Mean number of decoders in a block that shows the scene.",
    "at most": "Largest number of decoders in a block.",
    "divergence figures": "Divergence of the decoders for A and B.",
    "% of blocks": "Share of the blocks with this number of decoders, in per cent.",
    "% with so many or fewer": "Share of the blocks with at most this number of decoders, in per cent.",
    "path": "Decode path of the slot: the choice of auto, else its own.",
    **{
        f"{name} alone dB": f"PSNR in dB with only the {name} map decoded and all other maps original: higher is better."
        for name in MAPS
    },
    "column A": "Slot A.",
    "column B": "Slot B.",
    "column figure": "Name of the figure. Point at it to see its meaning.",
    "column picture": "Thumbnail of the texture.",
    "column name": "Name of the texture's image. Click to sort.",
    "column size": "Width x height of the original, in texels. Click to sort.",
    "column category": "Category of the texture, as its name suggests. Click to sort.",
    "column group": "Number of the group: textures of one group share a decoder. Click to sort.",
    "column bits": "Bits of latents, all mips, per texel of mip 0 as encoded, without tables of decoders. Click to sort.",
    "column kB": "Latents of this texture in the file, in kilobytes. Click to sort.",
    "column normals": "Mean angle in degrees between decoded and original normals: lower is better. Click to sort.",
    **{
        f"column {name} dB": f"PSNR of mip 0 of the {name} map in dB: higher is better. Click to sort." for name in MAPS
    },
    "rate curve": "PSNR of mip 0 in dB by bits per texel, measured on parts of the texture. The dot is the pack in slot A; its "
    "codes can hold the bitrates of the thick part. Drag to a bitrate to encode the texture again.",
    "rate text": "What the bitrate under the mouse gives.",
    "rate answer": "Bits per texel and file size of this texture for the PSNR at the left.",
    "asked quality": "PSNR of mip 0 in dB that the texture is to have.",
    "column on GPU": "Latents of this texture on the GPU now, in kilobytes. Click to sort.",
    "column members": "Number of textures in the group. Click to sort.",
    "column mip 0 dB": "PSNR in dB of mip 0, the largest, against the original, as measured when it was encoded: higher is better. "
    "For a group it is of the mean square error of its textures. Click to sort.",
    "column worst dB": "Lowest PSNR of mip 0 of the group's textures in dB. Click to sort.",
    "map legend": "Colours of the map over the picture and their values.",
    "group PSNR": "PSNR in dB of the mean square error of mip 0 of the group's textures: higher is better. Left of an arrow is the "
    "PSNR in the pack that training replaced.",
    "column run": "Number of the training run.",
    "column what": "Job of the run. Point at a line for details.",
    "column dB": "PSNR in dB of the mean square error of mip 0 of all textures: higher is better. A run that ended early has that of "
    "samples of all mips. Point at a line to see which of the two it is.",
    "column time": "Training time.",
    "column into": "Show the pack of the run in slot A or B.",
    "histogram": "Number of pixels by difference, for red, green and blue. Across: steps of 8-bit sRGB. Up: pixels, logarithmic.",
    "pixels of": "Pixels around the mouse, enlarged, with a frame around the middle one.",
    "slot 8-bit sRGB": "Red, green and blue of the pixel in this slot in 8-bit sRGB, 0 to 255.",
    "slot linear": "Red, green and blue of the pixel in this slot in linear light, 0 to 1.",
    "pixel material": "Material of the surface.",
    "pixel texture": "Number and name of the texture that the pixel reads.",
    "pixel uv": "Texture coordinates of the pixel: 0 to 1 is once across the texture.",
    "pixel lod": "Level of detail: 0 is the texture at full size, each further level halves it.",
    "pixel decoder": "Number of the decoder in A and B. Textures of a group share one.",
    "pixel D of": "Number of decoders that the pixel's block needs, in A and B.",
    "pixel": "Values of the middle pixel.",
    "errors table": "Visible textures or decoders, by the difference between A and B.",
    "sort by name": "Name of the texture, or number of the decoder. Click to sort.",
    "sort by decoder": "Decoder of the texture. Click to sort.",
    "sort by pixels": "Number of pixels that show it. Click to sort.",
    "sort by psnr": "PSNR of A against B over its pixels in dB: higher is better. Click to sort.",
    "sort by mean": "Mean of |A - B| over its pixels and channels, in steps of 8-bit sRGB. Click to sort.",
    "sort by max": "Largest |A - B| of its pixels and channels, in steps of 8-bit sRGB. Click to sort.",
    "encoded smaller": "Fewer texels are not compression: a pack is compared with originals of its own size.",
    "memory bars": "Bytes of the original textures, of BC7, and of what A and B show.",
    "times": "Time of each frame in ms: areas are steps of drawing, the line is the whole frame.",
    "progress": "Share of the work that is done.",
    "training run": "Run under way, or the one to accept or discard.",
    "training state": "Progress of the run, and the time left.",
    "training figure": "PSNR in dB of the mean square error: higher is better. Mip 0 is the largest mip; codec grid trains on samples "
    "of all mips, whose PSNR is higher or lower. Left of an arrow is the PSNR before.",
    "loss by group": "Loss that training minimises, for each group: lower is better.",
    "PSNR curve": "PSNR in dB over the training: the thick line is the mean of all textures, the blue one the chosen texture.",
    "honoured": "What of the file is shown as the file says.",
    "ignored": "What of the file is not shown.",
    "missing": "Files or parts that the scene names and that cannot be read, and what is used instead.",
    "repaired": "Values of the file that are broken, such as normals without a direction, and what is used instead.",
    "notes": "Other findings of reading the file.",
}
"""Sentences by label, with unit, range and the better direction; `#` stands for any number, `slot` for `A` or `B`."""

VALUES: Final = {
    # Sources
    "reference": "The original images, filtered by the graphics hardware.",
    # Light
    "sky": "A clear sky that follows the sun.",
    # Groupings
    "baseline": "Every texture has its own decoder: the best quality, and the most divergence.",
    "single": "All textures share one decoder: no divergence.",
    "random": "Random groups of textures, for comparison.",
    "category": "Textures of one category (brick, wood, ...) share a decoder.",
    "clustered": "Textures that look alike share a decoder.",
    "covisible": "Textures that are visible in the same blocks share a decoder: the least divergence for its number of groups.",
    "universal": "Tables that ship with the program and never saw the scene. Nothing is trained, and packs hold no tables.",
    # Codecs, recipes
    **SUMMARIES,
    "best": "The higher quality.",
    "paper": "The published training.",
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
    "on": "On.",
    "off": "Off.",
}
"""Explanations by the value as a command takes it."""

FORMATS: Final = {
    "bc1": "BC1: a block format of graphics hardware, 4 bits per texel.",
    "bc7": "BC7: a block format of graphics hardware, 8 bits per texel.",
    "astc-": "ASTC: a block format of graphics hardware, 128 bits for each block of this many texels.",
    "run ": "Pack of this training run. Keep the run to write it to a file.",
}
"""Explanations by the beginning of the value."""

TERMS: Final = {
    "A, B": "The two slots of the comparison. Each shows the original images, a block format, or a pack.",
    "adapter": "A few numbers of one texture that adjust the decoder it shares with others.",
    "anisotropy": "Number of samples by which the hardware keeps surfaces at a slant sharp.",
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
    "learning rate of the decoders": "Scale of the decoders' learning rate: 100 % is the full rate, at 0 % they are fixed.",
    "grid (codec)": "The published method: a grid of latents that is trained step by step together with its decoder.",
    "group": "Textures that share one decoder.",
    "grouping": "Rule that puts textures into groups: baseline, single, random, category, clustered, covisible or universal.",
    "latents": "Numbers that are stored for a texture instead of its texels.",
    "level of detail, lod": "Mip that a pixel reads: 0 is the full size, each further level halves it.",
    "loss": "Weighted error that training minimises.",
    "material set": "Maps of one material that are encoded together: base colour, normal, roughness and so on.",
    "mip": "Copy of a texture at half the size of the one before, for distant surfaces. Mip 0 is the largest.",
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
    "tile": "Square part of a texture that path cached decodes once and keeps.",
    "wave": "Pixels that a GPU shades together, 32 or 64 of them. If they need several decoders, all pixels wait for each.",
    "wave efficiency": "Share of decoder runs that would remain without divergence: 100 % is best.",
}
"""Meanings by term, in alphabetical order."""
