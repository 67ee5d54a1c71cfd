"""Statistics of the decoding shaders as GPU compilers compile them, without a GPU."""
