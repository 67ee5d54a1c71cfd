"""Help of the window: tooltips, glossary, sheet of keys."""
