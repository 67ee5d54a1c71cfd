"""Reading glTF 2.0: from JSON and binary chunks to plain data."""
