"""Panel "Timings": where the time of a frame goes, and what was left out."""

from imgui_bundle import imgui

from viewer.ui.facts import FrameFacts


def draw_timings_panel(facts: FrameFacts) -> None:
    """The content of the panel."""
    imgui.text(facts.renderer)
    imgui.text_disabled(f"medians, {facts.timer}")
    if imgui.begin_table("timings", 2, imgui.TableFlags_.sizing_stretch_prop):
        for name, milliseconds in facts.timings_ms.items():
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text(name.replace("_", " "))
            imgui.table_next_column()
            imgui.text(f"{milliseconds:9.2f} ms")
        imgui.end_table()
    imgui.separator()
    for name, count in (*facts.drawn.items(), *facts.skipped.items()):
        imgui.text(f"{count:>9,} {name.replace('_', ' ')}" + ("" if name in facts.drawn else " (skipped)"))
    for slot, tiles in facts.tiles.items():
        imgui.text(f"{tiles.resident:>9,} tiles of {slot.source} kept, {tiles.waiting:,} to come")
        if tiles.starved:
            imgui.text_wrapped(f"{tiles.starved:,} tiles find no room: raise tile_cache_megabytes in settings.json")
    imgui.text(f"{facts.frames_drawn:>9,} frames drawn")
