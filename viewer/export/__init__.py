"""What is made of a scene and a pack for other programs."""
