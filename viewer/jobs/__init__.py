"""Work beside the frames, in threads and processes."""
