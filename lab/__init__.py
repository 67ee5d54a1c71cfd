"""Research harness: benchmarks and studies of the codecs and the viewer."""
