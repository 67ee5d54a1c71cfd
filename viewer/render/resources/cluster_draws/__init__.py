"""What is drawn of a scene with many clusters: work for the GPU, and the commands that it writes."""
