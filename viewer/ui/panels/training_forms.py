"""Forms of a training, and the buttons that run them as commands."""

from typing import get_args

from imgui_bundle import ImVec2, imgui

from ntc.codec.config import GroupingName
from ntc.codec.encoding import RecipeName
from ntc.codec.model import Pack
from ntc.codec.registry import codec_named
from ntc.errors import InputError
from viewer.training.run_log import mean_of_psnr
from viewer.training.settings import AUTO, BUDGET_UNITS, TrainingSettings, budget_text, make_budget
from viewer.ui.controls import command_button, control
from viewer.ui.facts import UiFrame
from viewer.ui.panels.encode_form import NUMBER, UNIT_NAMES, USUAL_BUDGETS, EncodeForm, labelled
from viewer.ui.widgets import beside, combo, counted, em, list_width, text_width, wrapped_disabled

LIST_HEIGHT = 8.5
"""Height of the list of groups in font sizes."""


def _field(label: str, text: str, width: float, ui: UiFrame) -> str:
    imgui.set_next_item_width(em(width))
    changed = imgui.input_text(f"##{label}", text)[1]
    ui.rects.note(label)
    return changed


class TrainingForms:
    """Forms with what the user has filled in."""

    def __init__(self, defaults: TrainingSettings) -> None:
        self._encoding = EncodeForm("panel")
        self._strategy: str = defaults.strategy
        self._clusters = AUTO
        self._recipe: str = defaults.recipe
        self._unit = "s"
        self._value = USUAL_BUDGETS["s"]
        self._groups: set[int] = set()
        self._pointed_out: set[int] = set()
        """Groups under the mouse, which the picture highlights."""
        self._texture = 0
        self._group = "0"
        self._pack: Pack | None = None
        """Pack that groups and texture belong to."""

    def draw(self, pack: Pack | None, name: str, ui: UiFrame) -> None:
        """Draw the forms; `pack` is the one that a training would continue, open as `name`, None without one."""
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
            for label, form in (
                ("Retrain" if trains else "Bits", self._retrain if trains else _bits),
                ("Move", self._move),
                ("Regroup", self._regroup),
                ("Encode", self._encode_anew),
            ):
                shown = imgui.begin_tab_item(label)[0]
                ui.rects.note(f"tab {label}")
                if shown:
                    if label not in ("Encode", "Bits"):
                        wrapped_disabled(f"Continues from {name}: {counted(pack.grouping.group_count, 'group')}.")
                    form(pack, ui)
                    imgui.end_tab_item()
            imgui.end_tab_bar()

    def _length(self, codec: str, ui: UiFrame) -> str | None:
        """Draw budget and recipe of a codec that trains. Return the budget as a command takes it, None for a wrong one."""
        if not codec_named(codec).trains:
            return budget_text(TrainingSettings.budget)
        labelled("budget")
        self._value = _field("budget", self._value, NUMBER, ui)
        imgui.same_line()
        imgui.set_next_item_width(list_width(*UNIT_NAMES.values()))
        chosen = combo("budget unit", UNIT_NAMES[self._unit], tuple(UNIT_NAMES.values()), ui.rects)
        unit = next(unit for unit in BUDGET_UNITS if UNIT_NAMES[unit] == chosen)
        if unit != self._unit:
            self._unit, self._value = unit, USUAL_BUDGETS[unit]
        beside(list_width(*get_args(RecipeName)))
        imgui.set_next_item_width(list_width(*get_args(RecipeName)))
        self._recipe = combo("recipe", self._recipe, tuple(get_args(RecipeName)), ui.rects)
        try:
            make_budget(float(self._value), unit)
        except (InputError, ValueError):
            wrapped_disabled("The budget must be a number above 0.")
            return None
        return f"{self._value.strip()}{unit}"

    def _grouping(self, ui: UiFrame) -> None:
        labelled("grouping")
        imgui.set_next_item_width(list_width(*get_args(GroupingName)))
        self._strategy = combo("strategy", self._strategy, tuple(get_args(GroupingName)), ui.rects)
        if self._strategy in ("clustered", "random", "covisible"):
            beside(text_width("groups ") + em(NUMBER))
            imgui.text("groups")
            imgui.same_line()
            self._clusters = _field("k", self._clusters, NUMBER, ui)

    @staticmethod
    def _button(ui: UiFrame, title: str, command_id: str, *values: object, label: str = "") -> None:
        """Draw a button that runs a command with `values`; grey where one of them is None or empty."""
        missing = "fill in all fields above" if None in values or "" in values else ""
        command_button(ui, title, command_id, *values, label=label, missing=missing, size=ImVec2(-1, 0))

    @property
    def _k(self) -> str:
        return self._clusters.strip() or AUTO

    def _encode(self, ui: UiFrame) -> None:
        self._encoding.draw(ui)
        command_button(ui, "Encode this scene", "training.encode", missing=self._encoding.problem, size=ImVec2(-1, 0))

    def _encode_anew(self, _pack: Pack, ui: UiFrame) -> None:
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
        ui.rects.note("all groups")
        imgui.same_line()
        if imgui.small_button("none"):
            self._groups = set()
        ui.rects.note("no groups")
        budget = self._length(pack.config.kind, ui)
        groups = ",".join(map(str, sorted(self._groups)))
        title = f"Retrain {counted(len(self._groups), 'group')}" if self._groups else "Choose groups to retrain"
        self._button(ui, title, "training.retrain", groups, budget, self._recipe, label="Retrain")

    def _move(self, pack: Pack, ui: UiFrame) -> None:
        self._texture = min(self._texture, len(pack.textures) - 1)
        labels = tuple(f"{index} {t.name} (group {t.group})" for index, t in enumerate(pack.textures))
        labelled("texture")
        imgui.set_next_item_width(-1)
        self._texture = labels.index(combo("texture", labels[self._texture], labels, ui.rects))
        own = pack.textures[self._texture].group
        targets = (*(str(group) for group in range(pack.grouping.group_count) if group != own), "new")
        if self._group not in targets:
            self._group = targets[0]
        labelled("to group")
        imgui.set_next_item_width(list_width(*targets))
        self._group = combo("to group", self._group, targets, ui.rects)
        budget = self._length(pack.config.kind, ui)
        values = (str(self._texture), self._group, budget, self._recipe)
        self._button(ui, "Move and train both groups", "training.move", *values)

    def _regroup(self, pack: Pack, ui: UiFrame) -> None:
        self._grouping(ui)
        budget = self._length(pack.config.kind, ui)
        self._button(ui, "Regroup and train", "training.regroup", self._strategy, self._k, budget, self._recipe)


def _bits(_pack: Pack, ui: UiFrame) -> None:
    wrapped_disabled(
        "Choose a texture in the panel Textures to see what bits are worth to it, and to encode it with other bits."
    )
    command_button(ui, "Show the panel Textures", "window.panel", "Textures", True, size=ImVec2(-1, 0))


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
