"""Pictures of BLEND surfaces, as means of several samples."""
