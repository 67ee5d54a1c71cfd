"""The images of a glTF file: found out about while it is opened, gathered into textures, read when they are needed."""
