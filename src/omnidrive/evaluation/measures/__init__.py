"""Measures of a run: errors, effort, step response, recovery."""
