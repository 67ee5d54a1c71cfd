"""Pictures and camera paths as files."""
