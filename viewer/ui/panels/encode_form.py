"""How to encode the scene: the target, the grouping and the textures, and what they would give. Offer and panel draw the same form."""

from dataclasses import replace
from typing import get_args

from imgui_bundle import imgui

from ntc.codec.config import GroupingName
from ntc.codec.encoding import BitsTarget, RecipeName
from ntc.codec.registry import MODULES, codec_named
from ntc.errors import InputError
from viewer.scene.source_textures import MapChoice, has_source
from viewer.training.rates import chosen_textures
from viewer.training.settings import (
    AUTO,
    BUDGET_UNITS,
    FULL,
    TARGET_UNITS,
    SettingName,
    TrainingSettings,
    budget_text,
    target_parts,
    with_setting,
)
from viewer.ui.controls import command_button
from viewer.ui.facts import UiFrame
from viewer.ui.widgets import beside, combo, counted, em, list_width, text_width, wrapped_disabled

SIZES = (FULL, "64", "128", "256", "512", "1024", "2048", "4096")
USUAL_BUDGETS = {"s": "30", "steps": "1000", "dB": "35"}
USUAL_TARGETS = {"bits": "4", "dB": "40", "MB": "2"}
UNIT_NAMES = {"s": "seconds", "steps": "steps", "dB": "dB PSNR"}
TARGET_NAMES = {"bits": "bits per texel", "dB": "dB at least", "MB": "MB in all"}
MAP_NAMES: dict[str, MapChoice] = {"whole materials": "all", "base colours": "base"}
CHOICES = (2.0, 4.0, 8.0)
"""Bits per texel whose results stand beside the target."""
LABEL_PLACE = 6.0
"""Left edge of the fields, in font sizes."""
NUMBER = 4.5
"""Width of a field for a number, in font sizes."""
MOST_LISTED = 8.5
"""Height of the list of textures, in font sizes."""


def labelled(text: str) -> None:
    """Draw the label of a row of fields."""
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(em(LABEL_PLACE))


class Field:
    """Text field for a value that is kept elsewhere: it holds what is typed until that is right."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._text, self._shown = "", ""
        self._is_typed = False
        """True where the last frame changed the text: what is shown next follows from it."""
        self._number = 0
        """Number in the field's id: a new field where the value changes elsewhere, as ImGui keeps the text of an active one."""

    def draw(self, shown: str, ui: UiFrame) -> str | None:
        """Draw the field with the value `shown`, and return what was typed; None where nothing was."""
        if shown != self._shown and not self._is_typed:
            self._text, self._number = shown, self._number + 1
        self._shown = shown
        imgui.set_next_item_width(em(NUMBER))
        self._is_typed, self._text = imgui.input_text(f"##{self._label}{self._number}", self._text)
        ui.rects.note(self._label)
        return self._text if self._is_typed else None


class Setter:
    """Runs the command that chooses a setting, and keeps the reason why a typed value was refused."""

    def __init__(self) -> None:
        self._problem: dict[SettingName, str] = {}

    def set(self, ui: UiFrame, name: SettingName, text: str) -> bool:
        """Choose a value as it is typed, where it is right."""
        try:
            with_setting(ui.training.plan, name, text)
        except (InputError, ValueError) as error:
            self._problem[name] = str(error)
            return False
        self._problem.pop(name, None)
        ui.emit("training.choose", name, text)
        return True

    @property
    def problem(self) -> str:
        """Reason of the first refused value; "" for none."""
        return next(iter(self._problem.values()), "")


class EncodeForm:
    """Form of one place; all forms show and change the same choices."""

    def __init__(self, place: str) -> None:
        self._place = place
        self._target, self._groups, self._budget = Field("bits"), Field("k"), Field("budget")
        self._setter = Setter()

    @property
    def problem(self) -> str:
        """Reason why the form cannot be used; "" where it can."""
        return self._setter.problem

    def draw(self, ui: UiFrame) -> None:
        """Draw the fields, and below what they would give."""
        plan = ui.training.plan
        codec = codec_named(plan.codec_kind)
        if codec.default_target is not None:
            self._draw_target(plan, ui)
        self._draw_grouping(plan, ui)
        self._draw_textures(plan, ui)
        if self._place == "panel":
            labelled("codec")
            self._list("codec", plan.codec_kind, tuple(MODULES), "codec", ui)
            if codec.trains:
                self._draw_training(plan, ui)
        if self.problem:
            imgui.text_wrapped(self.problem)
            ui.rects.note("form problem")
        self._draw_forecast(plan, ui)

    def _list(self, label: str, current: str, choices: tuple[str, ...], name: SettingName, ui: UiFrame) -> None:
        imgui.set_next_item_width(list_width(*choices))
        chosen = combo(label, current, choices, ui.rects)
        if chosen != current:
            self._setter.set(ui, name, chosen)

    def _draw_target(self, plan: TrainingSettings, ui: UiFrame) -> None:
        labelled("target")
        textures = ui.session.scene.textures
        maps = max((textures[i].maps for i in chosen_textures(plan, ui.session.scene)), key=len, default=("base",))
        target = plan.target or codec_named(plan.codec_kind).target_of(maps if plan.chosen_maps == "all" else ("base",))
        assert target is not None
        value, unit = target_parts(target)
        typed = self._target.draw(f"{value:g}", ui)
        if typed is not None:
            self._setter.set(ui, "target", f"{typed.strip()}{unit}")
        imgui.same_line()
        names = tuple(TARGET_NAMES[each] for each in TARGET_UNITS)
        imgui.set_next_item_width(list_width(*names))
        chosen = combo("target unit", TARGET_NAMES[unit], names, ui.rects)
        if chosen != TARGET_NAMES[unit]:
            other = next(each for each in TARGET_UNITS if TARGET_NAMES[each] == chosen)
            forecast = ui.training.rates.forecast(plan, ui.session.scene)
            known = {
                "bits": forecast.bits if forecast is not None else None,
                "dB": forecast.psnr_db if forecast is not None else None,
                "MB": forecast.megabytes if forecast is not None else None,
            }[other]
            # What the present choice gives, where that is known: the choice changes as little as possible.
            self._setter.set(ui, "target", f"{f'{known:.3g}' if known else USUAL_TARGETS[other]}{other}")
        self._draw_choices(plan, ui)

    def _draw_choices(self, plan: TrainingSettings, ui: UiFrame) -> None:
        """Draw what some bitrates would give, as buttons that choose them; nothing before it is known."""
        for bits in CHOICES:
            target = BitsTarget(bits)
            found = ui.training.rates.forecast(replace(plan, target=target), ui.session.scene)
            if found is None or found.psnr_db is None or found.megabytes is None:
                return
            if bits != CHOICES[0]:
                beside(text_width(" 16 bits: 50 dB "))
            if imgui.small_button(f"{bits:g} bits: {found.psnr_db:.0f} dB##{self._place}"):
                self._setter.set(ui, "target", f"{bits:g}bits")
            ui.rects.note(f"target {bits:g} bits", found.line())

    def _draw_grouping(self, plan: TrainingSettings, ui: UiFrame) -> None:
        labelled("grouping")
        self._list("strategy", plan.strategy, get_args(GroupingName), "grouping", ui)
        if plan.strategy in ("clustered", "random", "covisible"):
            beside(text_width("groups ") + em(NUMBER))
            imgui.text("groups")
            imgui.same_line()
            typed = self._groups.draw(AUTO if plan.clusters is None else str(plan.clusters), ui)
            if typed is not None:
                self._setter.set(ui, "groups", typed.strip() or AUTO)

    def _draw_textures(self, plan: TrainingSettings, ui: UiFrame) -> None:
        labelled("textures")
        self._list("size", FULL if plan.texture_size is None else str(plan.texture_size), SIZES, "size", ui)
        beside(list_width(*MAP_NAMES))
        shown = next(name for name, maps in MAP_NAMES.items() if maps == plan.chosen_maps)
        imgui.set_next_item_width(list_width(*MAP_NAMES))
        chosen = combo("maps", shown, tuple(MAP_NAMES), ui.rects)
        if chosen != shown:
            self._setter.set(ui, "maps", MAP_NAMES[chosen])
        if self._place != "panel":
            return
        scene, ids = ui.session.scene, chosen_textures(plan, ui.session.scene)
        whole = [index for index, texture in enumerate(scene.textures) if has_source(texture, plan.chosen_maps)]
        title = f"{len(ids)} of {counted(len(whole), 'texture')}###which textures"
        opened = imgui.tree_node(title)
        ui.rects.note("which textures")
        if not opened:
            return
        if imgui.begin_child("list of textures", imgui.ImVec2(0, em(MOST_LISTED)), imgui.ChildFlags_.borders):
            for index in whole:
                name = scene.textures[index].name
                changed, ticked = imgui.checkbox(f"{name}##which {index}", index in ids)
                ui.rects.note(f"which texture {index}", name)
                if changed:
                    others = set(ids) | {index} if ticked else set(ids) - {index}
                    text = "all" if others == set(whole) else ",".join(map(str, sorted(others)))
                    self._setter.set(ui, "textures", text or "none")
        imgui.end_child()
        imgui.tree_pop()

    def _draw_training(self, plan: TrainingSettings, ui: UiFrame) -> None:
        """Draw budget and recipe of a codec that trains."""
        labelled("budget")
        text = budget_text(plan.budget)
        value = text.rstrip("stepdB")
        unit = text[len(value) :]
        typed = self._budget.draw(value, ui)
        if typed is not None:
            self._setter.set(ui, "budget", f"{typed.strip()}{unit}")
        imgui.same_line()
        imgui.set_next_item_width(list_width(*UNIT_NAMES.values()))
        chosen = combo("budget unit", UNIT_NAMES[unit], tuple(UNIT_NAMES[each] for each in BUDGET_UNITS), ui.rects)
        if chosen != UNIT_NAMES[unit]:
            other = next(each for each in BUDGET_UNITS if UNIT_NAMES[each] == chosen)
            self._setter.set(ui, "budget", f"{USUAL_BUDGETS[other]}{other}")
        beside(list_width(*get_args(RecipeName)))
        self._list("recipe", plan.recipe, get_args(RecipeName), "recipe", ui)

    @staticmethod
    def _draw_forecast(plan: TrainingSettings, ui: UiFrame) -> None:
        rates = ui.training.rates
        forecast = rates.forecast(plan, ui.session.scene)
        if forecast is None:
            wrapped_disabled("The scene has no textures to encode.")
            return
        imgui.text_wrapped(forecast.line())
        ui.rects.note("forecast")
        if rates.is_busy:
            imgui.text_disabled("measuring this machine and the textures ...")
        elif forecast.psnr_db is None and codec_named(plan.codec_kind).default_target is not None:
            command_button(ui, "Measure what bits give", "training.measure-rates", small=True)
