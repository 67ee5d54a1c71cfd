"""Scripts: commands and stage directions that are played with or without a window."""
