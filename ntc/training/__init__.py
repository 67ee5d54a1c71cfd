"""The trainer of all codecs, its requests and its reports."""
