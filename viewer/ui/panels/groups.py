"""Panel "Groups": groups of slot A's pack, their members, and the distance of each member from the group's centroid."""

from functools import partial

from imgui_bundle import ImVec2, imgui

from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.inspect.group_table import GroupDistances, GroupRow, group_distances, group_rows, grouping_features
from viewer.jobs.job import Background
from viewer.state.session import Session
from viewer.ui.controls import command_button, select_texture
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.widgets import cells, counted, decibels, headings, sort_order

THUMBNAIL_LINES = 1.6
LIST_LINES = 6.5
"""Largest height of the list of groups, in rows."""
TRAIN_GROUP = "Continue training this group alone; all others stay unchanged."
COLUMNS = ("group", "members", "mip 0 dB", "worst dB")


def _parameter(value: object) -> str:
    """Return a parameter of the grouping as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return " ".join(_parameter(part) for part in value)
    return str(value)


def quality_text(row: GroupRow) -> str:
    """Return a text of the PSNR of a group, with an arrow from its PSNR in the pack that training replaced, where known."""
    before = "" if row.before_db in (None, row.psnr_db) else f"{decibels(row.before_db)} -> "
    same = ", as before" if row.before_db is not None and row.before_db == row.psnr_db else ""
    return f"PSNR of mip 0: {before}{decibels(row.psnr_db)} dB{same}"


def replaced_source(session: Session, source: str) -> str | None:
    """Return the name of the open pack that a training run replaced by the pack `source`; None for none."""
    previous = session.previous_views.get(source)
    if previous is None:
        return None
    return next((slot.source for slot in (previous.slot_a, previous.slot_b) if slot.source in session.packs), None)


class GroupsPanel:
    """Panel Groups, with the rows of the shown pack and the chosen group."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._key: object = None
        self._order: object = None
        self._rows: tuple[GroupRow, ...] = ()
        self._shown: list[GroupRow] = []
        self._chosen = 0
        self._followed: int | None = None

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        source = ui.session.view.slot_a.source
        pack, match = ui.session.packs.get(source), ui.facts.matches.get(source)
        if pack is None or match is None:
            imgui.text_wrapped("Show a pack in slot A to see its groups.")
            return
        before = self._replaced(ui, source)
        if self._key != (ui.session.scene, pack, match, before):
            self._key, self._order = (ui.session.scene, pack, match, before), None
            self._rows = group_rows(pack, match, before)
            self._followed = None
        decoders = match.decoders(pack)
        self._follow_selection(ui.session.inspection.selected_texture, decoders)
        if not self._rows:
            imgui.text_disabled("The pack has no groups.")
            return
        parameters = ", ".join(
            f"{name.replace('_', ' ')} {_parameter(value)}" for name, value in pack.grouping.parameters.items()
        )
        imgui.text_wrapped(f"{source}: grouping {pack.grouping.name}, {counted(len(self._rows), 'group')}")
        if parameters:
            imgui.text_disabled(parameters[:200])
        self._list(ui)
        self._group(ui, pack, decoders)

    @staticmethod
    def _replaced(ui: UiFrame, source: str) -> tuple[Pack, PackMatch] | None:
        """Return the pack that the shown pack replaced, with its match; None for none."""
        name = replaced_source(ui.session, source)
        match = ui.facts.matches.get(name) if name is not None else None
        return (ui.session.packs[name], match) if name is not None and match is not None else None

    def _follow_selection(self, selected: int | None, decoders: tuple[int, ...]) -> None:
        """Show the group of a texture that another panel selected."""
        if selected != self._followed:
            self._followed = selected
            if selected is not None and decoders[selected] >= 0:
                self._chosen = decoders[selected]
        self._chosen = min(self._chosen, max(len(self._rows) - 1, 0))

    def _list(self, ui: UiFrame) -> None:
        flags = (
            imgui.TableFlags_.sortable
            | imgui.TableFlags_.row_bg
            | imgui.TableFlags_.scroll_y
            | imgui.TableFlags_.sizing_stretch_same
        )
        lines = min(LIST_LINES, len(self._rows) + 1.5)
        height = lines * (imgui.get_text_line_height() + 2.0 * imgui.get_style().cell_padding.y)
        if not imgui.begin_table("groups", len(COLUMNS), flags, ImVec2(0, height)):
            return
        imgui.table_setup_scroll_freeze(0, 1)
        for number, name in enumerate(COLUMNS):
            imgui.table_setup_column(name, 0, 0.0, number)
        headings({name: FIGURES[f"column {name}"] for name in COLUMNS}, ui.rects)
        self._sort()
        clipper = imgui.ListClipper()
        clipper.begin(len(self._shown))
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                row = self._shown[index]
                imgui.table_next_row()
                imgui.table_next_column()
                span = imgui.SelectableFlags_.span_all_columns
                if imgui.selectable(str(row.group), row.group == self._chosen, span)[0]:
                    self._chosen = row.group
                ui.rects.note(f"group {row.group}", "Click: list the members of this group below.")
                absent = f" + {row.absent} not here" if row.absent else ""
                cells(f"{len(row.members)}{absent}", decibels(row.psnr_db), decibels(row.worst_db))
        imgui.end_table()

    def _sort(self) -> None:
        order = sort_order()
        if order is None:
            self._shown = list(self._rows)
            return
        if order == self._order:
            return
        self._order = order
        keys = (
            lambda row: row.group,
            lambda row: len(row.members),
            lambda row: row.psnr_db if row.psnr_db is not None else float("inf"),
            lambda row: row.worst_db if row.worst_db is not None else float("inf"),
        )
        self._shown = sorted(self._rows, key=keys[order[0]], reverse=order[1])

    def _group(self, ui: UiFrame, pack: Pack, decoders: tuple[int, ...]) -> None:
        row = self._rows[self._chosen]
        imgui.text(quality_text(row))
        ui.rects.note(
            "group PSNR",
            "PSNR in dB of the mean square error of mip 0 of the group's textures: higher is better. Left of an arrow "
            "is the PSNR in the pack that training replaced.",
        )
        command_button(
            ui, f"Train group {row.group}", "training.retrain", str(row.group), label="Train group", tip=TRAIN_GROUP
        )
        distances = self._distances(ui, pack, decoders)
        by_texture = distances.by_texture if isinstance(distances, GroupDistances) else {}
        members = sorted(row.members, key=lambda texture: -by_texture.get(texture, 0.0))
        imgui.text_wrapped(distances.caption() if isinstance(distances, GroupDistances) else distances)
        side = THUMBNAIL_LINES * imgui.get_font_size()
        if not imgui.begin_child("members"):
            imgui.end_child()
            return
        far = max((by_texture.get(texture, 0.0) for texture in members), default=0.0)
        clipper = imgui.ListClipper()
        clipper.begin(len(members), side + imgui.get_style().item_spacing.y)
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                self._member(ui, members[index], by_texture.get(members[index]), far, side)
        imgui.end_child()

    def _member(self, ui: UiFrame, texture: int, distance: float | None, far: float, side: float) -> None:
        at = imgui.get_cursor_pos()
        flags = imgui.SelectableFlags_.allow_double_click
        if imgui.selectable(
            f"##member {texture}", texture == ui.session.inspection.selected_texture, flags, ImVec2(0, side)
        )[0]:
            select_texture(ui, texture)
            self._followed = texture
        ui.rects.note(
            f"member {texture}",
            "A texture of the group. Click selects it in all panels; double-click opens the flat view. The bar is its "
            "distance from the group's centroid, in features.",
        )
        imgui.set_cursor_pos(at)
        if ui.facts.thumbnail is not None:
            imgui.image(ui.facts.thumbnail(texture), ImVec2(side, side))
            imgui.same_line()
        if distance is not None:
            share = distance / far if far > 0.0 else 0.0
            imgui.progress_bar(share, ImVec2(4.5 * imgui.get_font_size(), 0), f"{distance:.2f}")
            imgui.same_line()
        imgui.text(ui.session.scene.textures[texture].name)

    def _distances(self, ui: UiFrame, pack: Pack, decoders: tuple[int, ...]) -> GroupDistances | str:
        """Return the distances of all textures from the centroids of their groups, or the reason why there are none."""
        asked = grouping_features(pack)
        if asked is None:
            return "no distances: the pack was not grouped by features"
        features, stands_in_for = asked
        # Centroids differ by grouping; the features that they are means of are cached on disk.
        key = (ui.session.scene, decoders, features)
        job = self._background.submit(
            key, partial(group_distances, ui.session.scene, decoders, features, stands_in_for)
        )
        if not job.done:
            return f"{features} features {job.report.share:.0%}"
        return f"no distances: {job.problem}" if job.problem else job.result()
