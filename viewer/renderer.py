"""The frame: which passes run, in which order, and which of them may be skipped because nothing they read has changed."""
