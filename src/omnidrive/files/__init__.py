"""Bounded reading of untrusted files, and outputs that are complete or absent."""
