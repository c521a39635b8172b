"""Planar rigid-body simulation with Coulomb friction at every wheel; compiled."""

from omnidrive.simulation.planar.batch import simulate_batch
from omnidrive.simulation.planar.plant import PlanarPlant

__all__ = ["PlanarPlant", "simulate_batch"]
