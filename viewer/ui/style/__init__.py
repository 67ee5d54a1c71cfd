"""How panels look: colours of the themes, and sizes that follow the font."""
