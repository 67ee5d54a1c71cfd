"""What sharing decoders costs and saves in a scene: groupings trained at equal steps, samples and latents, and measured alike."""
