"""Forms of a training, with the buttons that start it."""

from imgui_bundle import ImVec2, imgui

from ntc.codec.model import Pack
from ntc.codec.registry import codec_named
from viewer.training.run_log import mean_of_psnr
from viewer.training.settings import AUTO, TrainingSettings, budget_text
from viewer.ui.controls import command_button, control
from viewer.ui.facts import UiFrame
from viewer.ui.panels.encode_form import EncodeForm, GroupingFields
from viewer.ui.widgets import combo, counted, em, labelled, list_width, wrapped_disabled

LIST_HEIGHT = 8.5
"""Height of the list of groups in font sizes."""
TO_GROUP = "Group that the texture joins; new makes a group for it alone."
SHOW_TEXTURES = "Bring the panel Textures to the front."


class TrainingForms:
    """Forms of the panel Training, with the values that the user has filled in."""

    def __init__(self) -> None:
        self._encoding, self._fields = EncodeForm("panel"), GroupingFields(self._store)
        self._plan = TrainingSettings()
        """Settings of a training that continues the pack."""
        self._groups: set[int] = set()
        self._pointed_out: set[int] = set()
        """Groups under the mouse, which the picture highlights."""
        self._texture = 0
        self._group = "0"
        self._pack: Pack | None = None
        """Pack that groups and texture belong to."""

    def _store(self, _ui: UiFrame, plan: TrainingSettings, _name: str, _text: str) -> None:
        self._plan = plan

    def draw(self, pack: Pack | None, name: str, ui: UiFrame) -> None:
        """Draw the forms. `pack` is the open pack called `name` that a training would continue; None without one."""
        if pack is None:
            imgui.text_wrapped("This scene has no pack. Encode it:")
            self._encode(ui)
            control(ui, "training.ahead", label="prepare ahead", title="prepare encoding early")
            return
        if pack is not self._pack:
            same = self._pack is not None and self._pack.grouping.groups == pack.grouping.groups
            self._groups = self._groups if same else set()
            self._pack = pack
        if imgui.begin_tab_bar("training forms"):
            trains = codec_named(pack.config.kind).trains
            first = (
                ("Retrain", self._retrain, "Continue training chosen groups of the pack.")
                if trains
                else ("Bits", _bits, "Encode single textures with more or fewer bits.")
            )
            for label, form, tip in (
                first,
                ("Move", self._move, "Move a texture into another group."),
                ("Regroup", self._regroup, "Make new groups, and train those that changed."),
                ("Encode", self._encode_again, "Encode the scene into a new pack."),
            ):
                shown = imgui.begin_tab_item(label)[0]
                ui.rects.note(f"tab {label}", tip)
                if shown:
                    if label not in ("Encode", "Bits"):
                        wrapped_disabled(f"Continues from {name}: {counted(pack.grouping.group_count, 'group')}.")
                    form(pack, ui)
                    imgui.end_tab_item()
            imgui.end_tab_bar()

    def _length(self, codec: str, ui: UiFrame) -> tuple[str, str]:
        """Draw budget and recipe of a codec that trains. Returns their texts, as commands take them."""
        if codec_named(codec).trains:
            self._fields.draw_training(self._plan, ui)
        self._fields.draw_problem(ui)
        return budget_text(self._plan.budget), self._plan.recipe

    def _button(self, ui: UiFrame, title: str, command_id: str, *values: object, label: str = "") -> None:
        """Draw a button that runs a command with `values`. It is grey while a value is invalid or empty."""
        missing = self._fields.problem or ("fill in all fields above" if "" in values else "")
        command_button(ui, title, command_id, *values, label=label, missing=missing, size=ImVec2(-1, 0))

    def _encode(self, ui: UiFrame) -> None:
        self._encoding.draw(ui)
        command_button(ui, "Encode this scene", "training.encode", missing=self._encoding.problem, size=ImVec2(-1, 0))

    def _encode_again(self, _pack: Pack, ui: UiFrame) -> None:
        wrapped_disabled("The result is a new pack.")
        self._encode(ui)

    def _retrain(self, pack: Pack, ui: UiFrame) -> None:
        hovered: set[int] = set()
        if imgui.begin_child("groups", ImVec2(0, em(LIST_HEIGHT)), imgui.ChildFlags_.borders):
            for group, line in enumerate(_group_lines(pack)):
                changed, chosen = imgui.checkbox(f"{line}##{group}", group in self._groups)
                ui.rects.note(
                    f"group {group}", f"Group {line.strip()}: PSNR of mip 0, of all its textures and of the worst."
                )
                if imgui.is_item_hovered():
                    hovered = {group}
                if changed:
                    self._groups ^= {group} if chosen != (group in self._groups) else set()
        imgui.end_child()
        if hovered != self._pointed_out:
            self._pointed_out = hovered
            ui.emit("training.point-out", frozenset(hovered))
        if imgui.small_button("all"):
            self._groups = set(range(pack.grouping.group_count))
        ui.rects.note("all groups", "Choose all groups.")
        imgui.same_line()
        if imgui.small_button("none"):
            self._groups = set()
        ui.rects.note("no groups", "Choose no group.")
        length = self._length(pack.config.kind, ui)
        groups = ",".join(map(str, sorted(self._groups)))
        title = f"Retrain {counted(len(self._groups), 'group')}" if self._groups else "Choose groups to retrain"
        self._button(ui, title, "training.retrain", groups, *length, label="Retrain")

    def _move(self, pack: Pack, ui: UiFrame) -> None:
        self._texture = min(self._texture, len(pack.textures) - 1)
        labels = tuple(f"{index} {t.name} (group {t.group})" for index, t in enumerate(pack.textures))
        labelled("texture")
        imgui.set_next_item_width(-1)
        self._texture = labels.index(combo("texture", labels[self._texture], labels, ui.rects, "Texture to move."))
        current_group = pack.textures[self._texture].group
        targets = (*(str(group) for group in range(pack.grouping.group_count) if group != current_group), "new")
        if self._group not in targets:
            self._group = targets[0]
        labelled("to group")
        imgui.set_next_item_width(list_width(*targets))
        self._group = combo("to group", self._group, targets, ui.rects, TO_GROUP)
        values = (str(self._texture), self._group, *self._length(pack.config.kind, ui))
        self._button(ui, "Move and train both groups", "training.move", *values)

    def _regroup(self, pack: Pack, ui: UiFrame) -> None:
        plan = self._plan
        self._fields.draw_grouping(plan, ui)
        groups = AUTO if plan.clusters is None else str(plan.clusters)
        values = (plan.strategy, groups, *self._length(pack.config.kind, ui))
        self._button(ui, "Regroup and train", "training.regroup", *values)


def _bits(_pack: Pack, ui: UiFrame) -> None:
    wrapped_disabled(
        "Choose a texture in the panel Textures to see its PSNR by bits per texel, and to encode it with other bits."
    )
    command_button(
        ui, "Show the panel Textures", "window.panel", "Textures", True, tip=SHOW_TEXTURES, size=ImVec2(-1, 0)
    )


def _group_lines(pack: Pack) -> list[str]:
    members: dict[int, list[float | None]] = {group: [] for group in range(pack.grouping.group_count)}
    for texture in pack.textures:
        members[texture.group].append(texture.psnr_db)
    lines = []
    for group, values in members.items():
        known = [value for value in values if value is not None]
        quality = f"{mean_of_psnr(known):.1f} dB, worst {min(known):.1f}" if known else "PSNR unknown"
        lines.append(f"{group:>3}: {counted(len(values), 'texture')}, {quality}")
    return lines
