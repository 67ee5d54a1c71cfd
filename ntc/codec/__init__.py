"""The codec: from latents to texels, in numpy float64 and in torch."""
