"""What explains the window: tooltips, the glossary, the sheet of keys."""
