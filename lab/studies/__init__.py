"""Studies: measurements over many settings as tables and plots."""
