"""Scripts of commands and stage directions, played with or without a window."""
