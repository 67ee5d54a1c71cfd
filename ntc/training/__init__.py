"""Training latents and decoders of groups."""
