"""Bounded reading of files that may be malformed or hostile."""
