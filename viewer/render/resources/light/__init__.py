"""What lights a view, on the GPU."""
