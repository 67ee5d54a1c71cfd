"""The research harness: benchmarks and studies of the codec and the viewer."""
