"""A copy of a scene whose images are what a pack decodes to, compressed again where that is asked: inference on load."""
