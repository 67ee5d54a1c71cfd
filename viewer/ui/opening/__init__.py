"""What a window shows before there is something to look at: the card of first steps, and dialogs that choose a file."""
