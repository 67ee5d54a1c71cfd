"""Windows that nobody touches must rest on the picture that `render` draws."""
