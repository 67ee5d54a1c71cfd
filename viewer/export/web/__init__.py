"""A page that shows a scene and decodes its textures from a pack: a folder for any file server."""
