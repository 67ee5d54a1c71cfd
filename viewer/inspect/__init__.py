"""Tables and figures for panels, without a window: no ImGui."""
