"""What entries of lists stand for: decode paths, precisions, groupings and other terms that a command takes."""

from typing import Final

from ntc.codec.registry import SUMMARIES

VALUES: Final = {
    # Sources
    "reference": "The original images, filtered by the graphics hardware.",
    # Decode paths
    "auto": "Let the program choose: it measures.",
    "forward": "Decode while the surfaces are drawn, for every pixel that is shaded.",
    "deferred": "Find the visible surfaces first, then decode once for each pixel.",
    "binned": "Find the visible surfaces first, sort pixels by their decoder, then decode.",
    "cached": "Decode tiles of textures once and keep them; the graphics hardware filters them. Fast while the view changes little.",
    # Precision
    "fp32": "32-bit numbers: exact.",
    "fp16": "Decoders are stored in 16-bit numbers; arithmetic is in 32 bits.",
    "fp16-arithmetic": "Storage and arithmetic in 16-bit numbers, sums in 32 bits.",
    "fp16-accumulate": "Storage, arithmetic and sums in 16-bit numbers: the fastest, and the least exact.",
    # Comparison
    "a": "Slot A.",
    "b": "Slot B.",
    "wipe": "A left of the divider, B right of it.",
    "wipe-horizontal": "A above the divider, B below it.",
    "side-by-side": "The middle half of the picture from A on the left, the same half from B on the right.",
    "difference": "How much A and B differ in each pixel.",
    "raw": "|A - B| of sRGB values, as it is.",
    "amplified": "|A - B| of sRGB values times a gain.",
    "relative": "|A - B| / A of linear light: how large the error is for how bright the pixel is.",
    "flip": "FLIP: how different the two look when you flip between them. Dark is 0, bright is 1.",
    # Overlays
    "divergence": "How many decoders each block of pixels needs.",
    "error-texture": "The error of each texture between A and B.",
    "error-decoder": "The error of each decoder between A and B.",
    "green-red": "Green for few, red for many.",
    "viridis": "Dark violet for few, yellow for many: the colour-blind can read it too.",
    "8x8": "Blocks of 8x8 pixels, as a wave of 64 lanes shades them.",
    "8x4": "Blocks of 8x4 pixels, as a wave of 32 lanes shades them.",
    "16x4": "Blocks of 16x4 pixels, as a wave of 64 lanes shades them.",
    "4x4": "Blocks of 4x4 pixels, as a wave of 16 lanes shades them.",
    # Materials and light
    "lit": "Surfaces in the light.",
    "base": "Base colours without light.",
    "normal": "Normal maps, as they are stored.",
    "orm": "Occlusion, roughness and metalness, as red, green and blue.",
    "emissive": "Emitted light.",
    "roughness": "The roughness map.",
    "metalness": "The metalness map.",
    "occlusion": "The occlusion map.",
    "sky": "The sky that the sun makes.",
    "neutral": "Khronos PBR Neutral: keeps base colours as they are.",
    "agx": "AgX: bleaches bright light as film does.",
    # Filters
    "exact": "All texels of a pixel's footprint.",
    "stochastic": "One texel of the footprint at random; at rest the picture becomes exact.",
    # Camera, window
    "orbit": "The mouse turns the camera about what it looks at.",
    "fly": "The mouse looks round; W A S D Q E move.",
    "dark": "Light text on dark panels.",
    "light": "Dark text on light panels.",
    # Groupings
    "baseline": "Every texture has a decoder of its own: the best quality, and the most divergence.",
    "single": "All textures share one decoder: no divergence.",
    "random": "Textures are put into groups at random: for comparison.",
    "category": "Textures of one category (brick, wood, ...) share a decoder.",
    "clustered": "Textures that look alike share a decoder.",
    "covisible": "Textures that are seen in the same blocks share a decoder: the least divergence for its number of groups.",
    "universal": "The decoder that comes with the program; it has never seen the scene. Nothing is trained.",
    # Codecs, recipes
    **SUMMARIES,
    "best": "The higher quality.",
    "paper": "As the published method trains.",
    # Pictures
    "shown": "The picture as it is shown.",
    "split": "Both slots with the divider.",
    "plain": "The picture without a map over it.",
    "on": "On.",
    "off": "Off.",
}
"""By the value as a command takes it."""

FORMATS: Final = {
    "bc1": "BC1: a format that graphics hardware reads, 4 bits a texel.",
    "bc7": "BC7: a format that graphics hardware reads, 8 bits a texel.",
    "astc-": "ASTC: a format that graphics hardware reads, 128 bits for each block of this many texels.",
    "run ": "The pack of this training run; it is not in a file unless it was accepted.",
}
"""By how the value begins."""
