"""Studies: measurements over many settings, as tables and plots. One file for each question."""
