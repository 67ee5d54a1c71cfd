"""Format 1 of codec `block`, which is read but no longer written."""
