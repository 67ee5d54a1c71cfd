"""The images of a glTF file: examined while it is opened, gathered into textures, decoded again when pixels are needed."""
