"""Windows that nobody touches: programs that let them rest, and the pictures that they must rest on."""
