"""The words that the window uses, in plain sentences."""

from typing import Final

TERMS: Final = (
    (
        "A, B",
        "The two slots that are compared. Each shows the original images, a format of graphics hardware, or a pack.",
    ),
    ("adapter", "A few numbers of one texture that adjust the decoder it shares with others."),
    ("anisotropy", "How many samples the hardware takes to keep a texture sharp that is seen at a slant."),
    (
        "BC1, BC7, ASTC",
        "Formats of compressed textures that graphics hardware reads directly: 4 bits, 8 bits, or 0.9 to 8 bits a texel.",
    ),
    ("bits per texel", "Size of the stored texture divided by its texels. An uncompressed RGBA image has 32."),
    ("block (codec)", "Latents for blocks of 4x4 or 8x8 texels, found in closed form, so that encoding takes seconds."),
    (
        "block (of the map)",
        "A group of pixels that the GPU shades together, 8x8 pixels unless another shape is chosen.",
    ),
    ("codec", "How latents become texels: block or grid."),
    ("decode path", "Where and when texels are decoded: forward, deferred, binned or cached. The picture is the same."),
    ("decoder", "A small neural network that turns latents into texels. The textures of a group share one."),
    (
        "divergence",
        "Pixels of one block that need different decoders: the GPU has to run all of them, one after the other.",
    ),
    ("divergence map", "D for each block: how many different decoders its pixels need. 0 where nothing is decoded."),
    ("excess", "Decoders that a block needs beyond its first, summed over all blocks: 0 means no divergence."),
    (
        "FLIP",
        "A measure of the difference that an eye sees when it flips between two pictures: 0 is equal, 1 is the most.",
    ),
    ("freezing", "In training, how far the decoder is still free to change: 1 is free, 0 is fixed."),
    ("grid (codec)", "The published method: a grid of latents that is trained step by step together with its decoder."),
    ("group", "Textures that share one decoder."),
    (
        "grouping",
        "The rule that puts textures into groups: baseline, single, random, category, clustered, covisible or universal.",
    ),
    ("latents", "The numbers that are stored for a texture in the place of its texels."),
    ("level of detail, lod", "Which mip a pixel reads: 0 is the full size, each further one halves it."),
    ("loss", "What training makes smaller: the error, with some weights."),
    ("material set", "The maps of one material that are encoded together: base colour, normal, roughness and so on."),
    ("mip", "A smaller copy of a texture for surfaces far away. Mip 0 is the largest."),
    ("pack", "A .ntc file: all encoded textures and the decoders of one grouping of a scene."),
    ("precision", "The number format of decoders on the GPU: fp32 (32 bits) or fp16 (16 bits)."),
    (
        "PSNR",
        "Peak signal-to-noise ratio, dB: higher is better. Above 40 dB a difference is hard to see, below 30 dB it is plain.",
    ),
    ("recipe", "Settings of training: best for quality, paper as published."),
    ("reference", "The original images, filtered by the graphics hardware."),
    ("run", "One training, from its start to its end. Its pack is yours when you accept it."),
    ("score", "The excess divided by the number of blocks: how many needless decoders a block has on average."),
    ("slot", "One of the two sides of the comparison, A or B."),
    ("SSIM", "Structural similarity of two pictures, at most 1: 1 is equal."),
    ("texel", "A pixel of a texture."),
    ("tile", "A square part of a texture that path cached decodes once and keeps."),
    (
        "wave",
        "The pixels that a GPU shades in step, 32 or 64 of them. If they need several decoders, all pixels wait for each.",
    ),
    ("wave efficiency", "Share of decoder runs that would be needed without divergence: 100 % is best."),
)
"""(word, what it means), in the order of the alphabet."""
