"""Widgets that run commands: grey while the command cannot run, with the reason as their tooltip."""

from imgui_bundle import ImVec2, imgui

from viewer.ui.facts import UiFrame


def explained(text: str, reason: str) -> str:
    """Return a tooltip: the explanation, and the reason why the widget is grey."""
    return "\n".join(part for part in (text, f"Not now: {reason}" if reason else "") if part)


def command_button(
    ui: UiFrame,
    title: str,
    command_id: str,
    *values: object,
    label: str = "",
    missing: str = "",
    size: ImVec2 | None = None,
    small: bool = False,
) -> None:
    """Draw a button that runs a command with `values`.

    `label` names it for scripts and tooltips, where that is not its title. `missing` says what else is missing to run it.
    """
    reason, label = missing or ui.why_not(command_id), label or title
    imgui.begin_disabled(bool(reason))
    clicked = imgui.small_button(title) if small else imgui.button(title, size or ImVec2(0, 0))
    imgui.end_disabled()
    ui.rects.note(label, explained(ui.rects.explanation(label), reason) if reason else "")
    if clicked and not reason:
        ui.emit(command_id, *values)
