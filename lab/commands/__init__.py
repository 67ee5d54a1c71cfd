"""`ntc-viewer bench` and `ntc-viewer study NAME`."""
