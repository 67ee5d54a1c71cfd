"""Form for encoding the scene: target, grouping, textures, and a forecast of the result. Offer and panel draw the same form."""

from collections.abc import Callable
from dataclasses import replace
from string import ascii_letters
from typing import get_args

from imgui_bundle import imgui

from ntc.codec.encoding import BitsTarget, RecipeName
from ntc.codec.registry import codec_named
from ntc.errors import InputError
from viewer.commands.command import Arg, typed
from viewer.scene.source_textures import has_source
from viewer.state.setting import sentence
from viewer.training.rates import chosen_textures
from viewer.training.settings import AUTO, FULL, SETTINGS, TrainingSettings, budget_text, target_text, with_setting
from viewer.ui.controls import command_button
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import value_text
from viewer.ui.widgets import beside, combo, counted, em, labelled, list_width, text_width, wrapped_disabled

USUAL_BUDGETS = {"s": "30", "steps": "1000", "dB": "35"}
USUAL_TARGETS = {"bits": "4", "dB": "40", "MB": "2"}
CHOICES = (2.0, 4.0, 8.0)
"""Bits per texel whose forecasts are offered as buttons."""
NUMBER = 4.5
"""Width of a number field, in font sizes."""
MOST_LISTED = 8.5
"""Height of the list of textures, in font sizes."""


def _list(label: str, current: str, choices: tuple[str, ...], arg: Arg, ui: UiFrame) -> str:
    """Draw a list as wide as its widest text, explained by `arg`, and return the chosen text."""

    def name(text: str) -> str:
        return arg.names.get(text, text)

    def about(text: str) -> str:
        return sentence(arg.values[text]) if text in arg.values else value_text(text)

    imgui.set_next_item_width(list_width(*map(name, choices)))
    return combo(label, current, choices, ui.rects, sentence(arg.help), name=name, about=about)


class Field:
    """Text field for a value of the state. It holds typed text until that is valid."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._text, self._shown = "", ""
        self._is_typed = False
        """True where the user changed the text in the last frame, so a change of the value follows from the text."""
        self._number = 0
        """Number in the field's id. A new id replaces the field when the value changes elsewhere, because ImGui ignores new text of an
        active one."""

    def draw(self, shown: str, ui: UiFrame, tip: str = "") -> str | None:
        """Draw the field with the value `shown`. Returns the text if the user has typed, else None."""
        if shown != self._shown and not self._is_typed:
            self._text, self._number = shown, self._number + 1
        self._shown = shown
        imgui.set_next_item_width(em(NUMBER))
        self._is_typed, self._text = imgui.input_text(f"##{self._label}{self._number}", self._text)
        ui.rects.note(self._label, tip)
        return self._text if self._is_typed else None


class GroupingFields:
    """Fields of grouping and training, for settings of the state. An invalid value is refused, and its problem is shown."""

    def __init__(self, store: Callable[[UiFrame, TrainingSettings, str, str], None]) -> None:
        """Make the fields. `store` receives the changed settings, and the name and text of the setting that changed."""
        self._store = store
        self._groups, self._budget = Field("k"), Field("budget")
        self._problem: dict[str, str] = {}

    @property
    def problem(self) -> str:
        """Problem of the first invalid value; "" for none."""
        return next(iter(self._problem.values()), "")

    def take(self, plan: TrainingSettings, ui: UiFrame, name: str, text: str) -> None:
        """Store a typed value if it is valid, else its problem."""
        try:
            changed = with_setting(plan, name, text)
        except (InputError, ValueError) as error:
            self._problem[name] = str(error)
        else:
            self._problem.pop(name, None)
            self._store(ui, changed, name, text)

    def choose(self, name: str, current: str, plan: TrainingSettings, ui: UiFrame, label: str = "") -> None:
        """Draw the list of a setting's choices or suggested numbers. `label` names it for scripts; the default is `name`."""
        arg = SETTINGS[name][1]
        largest = max((max(texture.size) for texture in ui.session.scene.textures), default=0)
        sizes = (typed(size) for size in arg.offers if size < largest)
        choices = arg.choices(None) if arg.choices is not None else (FULL, *sizes)
        chosen = _list(label or name, current, tuple(choice for choice in choices if choice != AUTO), arg, ui)
        if chosen != current:
            self.take(plan, ui, name, chosen)

    def draw_measure(
        self, field: Field, name: str, text: str, plan: TrainingSettings, ui: UiFrame, usual: Callable[[str], str]
    ) -> None:
        """Draw number and unit of a setting with the value `text`. `usual` returns a number for another unit."""
        arg, value = SETTINGS[name][1], text.rstrip(ascii_letters)
        unit = text.removeprefix(value)
        number = field.draw(value, ui, sentence(arg.help))
        if number is not None:
            self.take(plan, ui, name, f"{number.strip()}{unit}")
        imgui.same_line()
        other = _list(f"{name} unit", unit, tuple(arg.names), arg, ui)
        if other != unit:
            self.take(plan, ui, name, f"{usual(other)}{other}")

    def draw_grouping(self, plan: TrainingSettings, ui: UiFrame) -> None:
        """Draw the grouping, and the number of groups where it can be chosen."""
        labelled("grouping")
        self.choose("grouping", plan.strategy, plan, ui, "strategy")
        if plan.strategy in ("clustered", "random", "covisible"):
            beside(text_width("groups ") + em(NUMBER))
            imgui.text("groups")
            imgui.same_line()
            shown, tip = AUTO if plan.clusters is None else str(plan.clusters), sentence(SETTINGS["groups"][1].help)
            count = self._groups.draw(shown, ui, tip)
            if count is not None:
                self.take(plan, ui, "groups", count.strip() or AUTO)

    def draw_training(self, plan: TrainingSettings, ui: UiFrame) -> None:
        """Draw budget and recipe of the training, for a codec that trains."""
        labelled("budget")
        self.draw_measure(self._budget, "budget", budget_text(plan.budget), plan, ui, USUAL_BUDGETS.__getitem__)
        beside(list_width(*get_args(RecipeName)))
        self.choose("recipe", plan.recipe, plan, ui)

    def draw_problem(self, ui: UiFrame) -> None:
        """Draw the problem of an invalid value."""
        if self.problem:
            imgui.text_wrapped(self.problem)
            ui.rects.note("form problem", "A value above is wrong.")


class EncodeForm(GroupingFields):
    """Form for encoding, in the offer or the panel. All forms show and change the same settings."""

    def __init__(self, place: str) -> None:
        super().__init__(lambda ui, _plan, name, text: ui.emit("training.choose", name, text))
        self._place, self._target = place, Field("bits")

    def draw(self, ui: UiFrame) -> None:
        """Draw the fields, and below them the forecast of the result."""
        plan = ui.training.plan
        codec = codec_named(plan.codec_kind)
        if codec.default_target is not None:
            self._draw_target(plan, ui)
        self.draw_grouping(plan, ui)
        self._draw_textures(plan, ui)
        if self._place == "panel":
            labelled("codec")
            self.choose("codec", plan.codec_kind, plan, ui)
            if codec.trains:
                self.draw_training(plan, ui)
        self.draw_problem(ui)
        self._draw_forecast(plan, ui)

    def _draw_target(self, plan: TrainingSettings, ui: UiFrame) -> None:
        labelled("target")
        textures = ui.session.scene.textures
        maps = max((textures[i].maps for i in chosen_textures(plan, ui.session.scene)), key=len, default=("base",))
        target = plan.target or codec_named(plan.codec_kind).target_of(maps if plan.chosen_maps == "all" else ("base",))
        assert target is not None

        def usual(other: str) -> str:
            forecast = ui.training.rates.forecast(plan, ui.session.scene)
            known = forecast and {"bits": forecast.bits, "dB": forecast.psnr_db, "MB": forecast.megabytes}[other]
            # The forecast of the current target in the other unit, so that the unit changes and the result hardly does.
            return f"{known:.3g}" if known else USUAL_TARGETS[other]

        self.draw_measure(self._target, "target", target_text(target), plan, ui, usual)
        self._draw_choices(plan, ui)

    def _draw_choices(self, plan: TrainingSettings, ui: UiFrame) -> None:
        """Draw buttons that choose a bitrate, each with its forecast; nothing until forecasts are known."""
        for bits in CHOICES:
            target = BitsTarget(bits)
            forecast = ui.training.rates.forecast(replace(plan, target=target), ui.session.scene)
            if forecast is None or forecast.psnr_db is None or forecast.megabytes is None:
                return
            if bits != CHOICES[0]:
                beside(text_width(" 16 bits: 50 dB "))
            if imgui.small_button(f"{bits:g} bits: {forecast.psnr_db:.0f} dB##{self._place}"):
                self.take(plan, ui, "target", f"{bits:g}bits")
            ui.rects.note(f"target {bits:g} bits", forecast.line())

    def _draw_textures(self, plan: TrainingSettings, ui: UiFrame) -> None:
        labelled("textures")
        size = FULL if plan.texture_size is None else str(plan.texture_size)
        self.choose("size", size, plan, ui)
        beside(list_width(*SETTINGS["maps"][1].names.values()))
        self.choose("maps", plan.chosen_maps, plan, ui)
        if self._place != "panel":
            return
        scene, ids = ui.session.scene, chosen_textures(plan, ui.session.scene)
        whole = [index for index, texture in enumerate(scene.textures) if has_source(texture, plan.chosen_maps)]
        title = f"{len(ids)} of {counted(len(whole), 'texture')}###which textures"
        opened = imgui.tree_node(title)
        ui.rects.note("which textures", "Textures to encode: open the list to leave some out.")
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
                    self.take(plan, ui, "textures", text or "none")
        imgui.end_child()
        imgui.tree_pop()

    @staticmethod
    def _draw_forecast(plan: TrainingSettings, ui: UiFrame) -> None:
        rates = ui.training.rates
        forecast = rates.forecast(plan, ui.session.scene)
        if forecast is None:
            wrapped_disabled("The scene has no textures to encode.")
            return
        imgui.text_wrapped(forecast.line())
        ui.rects.note(
            "forecast",
            "Forecast of the result: file size, PSNR of all textures, and time. It is measured on parts of the largest textures, "
            "so the result may differ a little.",
        )
        if rates.is_busy:
            imgui.text_disabled("measuring rate curves ...")
        elif forecast.psnr_db is None and codec_named(plan.codec_kind).default_target is not None:
            command_button(ui, "Measure rate curve", "training.measure-rates", small=True)
