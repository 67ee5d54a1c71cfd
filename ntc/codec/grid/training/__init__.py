"""Training of codec `grid`: latents and decoders by gradient descent."""
