"""Panel "Divergence": settings of the map, figures of A and B, plots, and the block under the mouse."""

import numpy as np
from imgui_bundle import ImVec2, imgui, implot

from ntc.metrics.divergence import DivergenceStatistics, cut_percent
from viewer.inspect.picking import BlockContent
from viewer.state.view_state import is_image_source
from viewer.ui.controls import command_button, control
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.theme import side_ink
from viewer.ui.widgets import beside, counted, list_width, named_cells

PLOT_LINES = 9.5
"""Height of a plot in lines of text."""
THUMBNAIL_LINES = 2.2
TEXTURES_SHOWN = 12


def _settings(ui: UiFrame) -> None:
    control(ui, "overlay.block")
    imgui.same_line()
    control(ui, "overlay.palette")
    beside(list_width("range of picture"))
    control(ui, "overlay.scale", width=-1.0)
    control(ui, "overlay.opacity")


def _sides(ui: UiFrame) -> dict[str, tuple[str, DivergenceStatistics]]:
    """Return (source, figures) of the sides whose decoders are counted."""
    slots = {"a": ui.session.view.slot_a, "b": ui.session.view.slot_b}
    return {
        side: (s.source, ui.facts.divergence[s.source]) for side, s in slots.items() if s.source in ui.facts.divergence
    }


def _figures(sides: dict[str, tuple[str, DivergenceStatistics]], ui: UiFrame) -> None:
    rows = {
        "shows": [source for source, _ in sides.values()],
        "score": [f"{figures.score:.4f}" for _, figures in sides.values()],
        "excess": [f"{figures.excess:,}" for _, figures in sides.values()],
        "divergent blocks": [f"{figures.divergent_blocks:,}" for _, figures in sides.values()],
        "decoders per block": [f"{figures.mean:.3f}" for _, figures in sides.values()],
        "at most": [f"{figures.maximum}" for _, figures in sides.values()],
        "wave efficiency": [f"{figures.wave_efficiency:.1%}" for _, figures in sides.values()],
    }
    flags = imgui.TableFlags_.borders_inner_v | imgui.TableFlags_.sizing_stretch_prop
    if imgui.begin_table("divergence figures", 1 + len(sides), flags):
        imgui.table_next_row()
        imgui.table_next_column()
        for side in sides:
            imgui.table_next_column()
            imgui.text_colored(side_ink(side), side.upper())
        for name, texts in rows.items():
            imgui.table_next_row()
            named_cells(ui.rects, name, FIGURES[name], *texts)
        imgui.end_table()
        ui.rects.note("divergence figures", "Divergence of the decoders for A and B.")
    if len(sides) == 2:
        first, second = (figures.excess for _, figures in sides.values())
        cut = cut_percent(first, second)
        imgui.text("no excess in B" if cut is None else f"excess of A: {cut:.1f} % less than B")


def _plots(sides: dict[str, tuple[str, DivergenceStatistics]], ui: UiFrame) -> None:
    """Plot the share of covered blocks with D decoders, and with at most D, of both sides."""
    most = max(figures.maximum for _, figures in sides.values())
    counts = np.arange(1, max(most, 2) + 1, dtype=np.float64)
    flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text | implot.Flags_.no_legend
    ticks = counts[:: max(1, len(counts) // 8)]
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2.0
    size = ImVec2(half, PLOT_LINES * imgui.get_text_line_height_with_spacing())
    for title, cumulative in (("% of blocks", False), ("% with so many or fewer", True)):
        if implot.begin_plot(title, size, flags):
            implot.setup_axes("decoders", "", implot.AxisFlags_.no_grid_lines, 0)
            implot.setup_axis_ticks(implot.ImAxis_.x1, ticks.tolist(), [f"{count:.0f}" for count in ticks])
            implot.setup_axes_limits(0.4, float(counts[-1]) + 0.6, 0.0, 104.0, implot.Cond_.always)
            for number, (side, (source, figures)) in enumerate(sides.items()):
                blocks = np.zeros(len(counts))
                seen = np.array(figures.histogram[1 : len(counts) + 1], np.float64)
                blocks[: len(seen)] = seen
                shares = 100.0 * blocks / max(figures.covered_blocks, 1)
                color = side_ink(side)
                spec = implot.Spec(line_color=color, fill_color=color, line_weight=2.0)
                label = f"{side.upper()} {source}"
                if cumulative:
                    implot.plot_stairs(label, counts - 0.5, np.cumsum(shares), spec)
                else:
                    shift = 0.4 * (number - (len(sides) - 1) / 2.0)
                    implot.plot_bars(label, counts + shift, shares, 0.38, spec)
            implot.end_plot()
        ui.rects.note(title, FIGURES[title])
        if not cumulative:
            imgui.same_line()


def _block(block: BlockContent, ui: UiFrame) -> None:
    is_pinned = ui.session.inspection.block is not None
    imgui.text(f"block {block.place.column}, {block.place.row}")
    imgui.same_line()
    if is_pinned:
        command_button(ui, "release", "block.keep-at", None, tip="Follow the mouse again.", small=True)
    else:
        imgui.text_disabled("click to keep")
    slots = {"A": ui.session.view.slot_a.source, "B": ui.session.view.slot_b.source}
    shown = {side: source for side, source in slots.items() if not is_image_source(source)}
    decoders = [f"{side}: {counted(block.decoder_count(source), 'decoder')}" for side, source in shown.items()]
    imgui.text(", ".join([counted(len(block.textures), "texture"), *decoders]))
    ui.rects.note("block in the picture", "Textures in the block, and the decoders that it needs in each slot.")
    side = THUMBNAIL_LINES * imgui.get_text_line_height()
    for texture in block.textures[:TEXTURES_SHOWN]:
        if ui.facts.thumbnail is not None:
            imgui.image(ui.facts.thumbnail(texture.texture_id), ImVec2(side, side))
            imgui.same_line()
        of_texture = [f"{side} decoder {texture.decoders[source]}" for side, source in shown.items()]
        imgui.begin_group()
        imgui.text(texture.name)
        imgui.text_disabled(", ".join([counted(texture.pixels, "pixel"), *of_texture]))
        imgui.end_group()
        ui.rects.note(
            f"block texture {texture.texture_id}",
            "A texture in this block, with its pixels and its decoder in A and B.",
        )
    if len(block.textures) > TEXTURES_SHOWN:
        imgui.text_disabled(f"and {len(block.textures) - TEXTURES_SHOWN} more")


def draw_divergence_panel(ui: UiFrame) -> None:
    """Draw the content of the panel."""
    _settings(ui)
    sides = _sides(ui)
    if not sides:
        imgui.text_disabled("Show a pack in A or B to see its decoders.")
        return
    if ui.facts.is_preview:
        imgui.text_disabled("figures of the last full picture")
    _figures(sides, ui)
    imgui.separator()
    if ui.facts.block is not None:
        _block(ui.facts.block, ui)
    else:
        imgui.text_disabled("Point at a block of the picture.")
    imgui.separator()
    _plots(sides, ui)
