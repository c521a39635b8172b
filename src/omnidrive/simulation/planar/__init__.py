"""Planar rigid-body simulation with Coulomb friction at every wheel; compiled."""

from omnidrive.simulation.planar.open_loop import simulate_commands
from omnidrive.simulation.planar.plant import PlanarPlant

__all__ = ["PlanarPlant", "simulate_commands"]
