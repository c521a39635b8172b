"""Fuzzy systems."""
