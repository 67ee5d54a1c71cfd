"""libntc: the library in C that programs copy, and that ntc.decode calls where it was built (docs/reference/libntc.md)."""
