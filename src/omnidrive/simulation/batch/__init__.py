"""Many closed loops in compiled code."""

from omnidrive.simulation.batch.batch import run_generators, simulate_batch
from omnidrive.simulation.batch.results import BatchResults

__all__ = ["BatchResults", "run_generators", "simulate_batch"]
