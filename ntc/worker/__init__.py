"""Training in another process: the client, the process, and their messages."""
