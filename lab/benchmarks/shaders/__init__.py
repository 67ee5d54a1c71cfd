"""What the compilers of GPUs make of the decoding shaders, without a GPU."""
