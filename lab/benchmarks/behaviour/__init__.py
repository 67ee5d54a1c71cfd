"""Records of what the program does, file by file, for comparing two checkouts to the bit: see `__main__`."""
