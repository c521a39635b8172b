"""Headings along a path."""
