"""How wide texts and controls are, so that a row breaks where there is no room: sizes follow the font, whatever its scale."""

from imgui_bundle import imgui


def em(count: float) -> float:
    """So many font sizes, in window units."""
    return float(count * imgui.get_font_size())


def text_width(text: str) -> float:
    """Of a line of text, in window units."""
    return float(imgui.calc_text_size(text).x)


def list_width(*choices: str) -> float:
    """Of a drop-down list that shows each of these texts whole."""
    arrow = imgui.get_frame_height()
    return max(map(text_width, choices)) + arrow + 2.0 * imgui.get_style().frame_padding.x


def field_width(text: str) -> float:
    """Of a field, or a button, that shows this text whole."""
    return text_width(text) + 2.0 * imgui.get_style().frame_padding.x


def box_width(label: str) -> float:
    """Of a check box or a radio button with its label."""
    return text_width(label) + imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x


def beside(width: float) -> None:
    """Go on beside the last item where something so wide fits, else in the next line."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < width:
        imgui.new_line()


def wrapped_disabled(text: str) -> None:
    """Faint text over as many lines as it needs."""
    imgui.push_style_color(imgui.Col_.text, imgui.get_style().color_(imgui.Col_.text_disabled))
    imgui.text_wrapped(text)
    imgui.pop_style_color()


def disabled_beside(text: str) -> None:
    """Faint text beside the last item where it fits, else below it over as many lines as it needs."""
    beside(text_width(text))
    wrapped_disabled(text)
