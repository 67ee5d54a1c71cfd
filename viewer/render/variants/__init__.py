"""Which variant of the decoding shaders a device takes: measured once, and kept."""
