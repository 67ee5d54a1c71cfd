"""Work in another process: the process, its messages, and the training that runs in one."""
