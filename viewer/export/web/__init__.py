"""Export as a web page that decodes the scene's textures from a pack. The folder works on any file server."""
