"""Quality of pictures and textures, divergence, and block compression to compare with."""
