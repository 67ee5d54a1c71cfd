"""Sheets over the window with two columns and a search field: keys and mouse, and the glossary."""

from collections.abc import Callable, Sequence
from typing import Final

from imgui_bundle import ImVec2, imgui

from viewer.commands import bindings, key_table
from viewer.state.session import Session
from viewer.ui.facts import UiFrame

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
"""(word, meaning) in alphabetical order."""


WIDTH, HEIGHT = 640.0, 800.0
"""Largest size in window units at normal scale."""
Rows = Sequence[tuple[str, str]]


class Sheet:
    """Sheet of two columns with a search field."""

    def __init__(
        self,
        title: str,
        label: str,
        rows: Callable[[Session], Rows],
        is_open: Callable[[Session], bool],
        layer: str,
        hint: str,
    ) -> None:
        """Make a sheet. `label` names it for scripts, `rows` gives (word, meaning), `layer` is one of `commands.leaving.LAYERS`."""
        self._title, self._label, self._rows = title, label, rows
        self._is_open, self._layer, self._hint = is_open, layer, hint
        self._text = ""
        self._was_open = False
        self._typing = False

    def draw(self, ui: UiFrame, size: tuple[float, float], top: float) -> None:
        """Draw the sheet while the session has it open, below `top` in window units."""
        is_open = self._is_open(ui.session)
        opening, self._was_open = is_open and not self._was_open, is_open
        if not is_open:
            self._typing = False
            return
        scale = imgui.get_font_size() / 13.0
        middle = ImVec2(size[0] / 2.0, (top + size[1]) / 2.0)
        imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
        extent = ImVec2(min(WIDTH * scale, size[0] - 16.0), min(HEIGHT * scale, size[1] - top - 16.0))
        imgui.set_next_window_size(extent)
        imgui.set_next_window_bg_alpha(1.0)
        flags = imgui.WindowFlags_
        if opening:
            self._text = ""
            imgui.set_next_window_focus()
        opened, stays = imgui.begin(
            self._title, True, flags.no_collapse | flags.no_saved_settings | flags.no_docking | flags.no_resize
        )
        if opened:
            self._search(opening, ui)
            self._table(self._rows(ui.session))
            ui.rects.note(self._label)
        imgui.end()
        # The field owns the key in the frame in which it ends the typing.
        if not stays or (self._typing and imgui.is_key_pressed(imgui.Key.escape, repeat=False)):
            ui.emit("window.close-layer", self._layer)

    def _table(self, rows: Rows) -> None:
        if not imgui.begin_table(self._label, 2, imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg):
            return
        imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed)
        imgui.table_setup_column("meaning", imgui.TableColumnFlags_.width_stretch)
        sought = self._text.lower()
        for name, text in rows:
            if sought in f"{name} {text}".lower():
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text(name)
                imgui.table_next_column()
                imgui.text_wrapped(text)
        imgui.end_table()

    def _search(self, opening: bool, ui: UiFrame) -> None:
        imgui.set_next_item_width(-13.0 * imgui.get_font_size())
        if opening:
            imgui.set_keyboard_focus_here()
        _, self._text = imgui.input_text_with_hint("##search", "search", self._text)
        self._typing = imgui.is_item_active() or imgui.is_item_deactivated()
        ui.rects.note(f"search {self._label}")
        imgui.same_line()
        imgui.text_disabled(self._hint)


def make_sheets() -> tuple[Sheet, ...]:
    """Make the sheets of one window."""
    return (
        Sheet(
            "Keys and mouse",
            "keys",
            lambda session: key_table(bindings(session.settings.keys)),
            lambda session: session.window.show_help,
            "window.show_help",
            "F1 closes this",
        ),
        Sheet(
            "Words of this program",
            "glossary",
            lambda _session: TERMS,
            lambda session: session.window.show_glossary,
            "window.show_glossary",
            "Escape closes this",
        ),
    )
