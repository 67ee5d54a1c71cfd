"""Long trial of real windows on a virtual screen."""
