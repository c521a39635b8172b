"""Distributions that determine results."""

VERSIONS = ("omnidrive", "numpy", "scipy", "numba", "mujoco")
"""Distributions whose versions can change results."""
