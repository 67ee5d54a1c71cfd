"""Tables and figures of the panels, computed without ImGui."""
