"""Training in another process: the client, the process, and what they say to each other."""
