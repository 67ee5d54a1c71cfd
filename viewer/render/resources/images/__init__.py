"""Original images on the GPU: where each lies, within a budget."""
