"""Background work in threads and processes."""
