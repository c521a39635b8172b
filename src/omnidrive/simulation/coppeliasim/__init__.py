"""Plant in CoppeliaSim, the paper's simulator, through its remote API."""

from omnidrive.simulation.coppeliasim.plant import CoppeliaSimPlant
from omnidrive.simulation.coppeliasim.scene import CoppeliaSimScene

__all__ = ["CoppeliaSimPlant", "CoppeliaSimScene"]
