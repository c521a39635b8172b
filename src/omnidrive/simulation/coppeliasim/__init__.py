"""The paper's simulator, over its own remote API."""

from omnidrive.simulation.coppeliasim.plant import CoppeliaSimPlant
from omnidrive.simulation.coppeliasim.scene import CoppeliaSimScene

__all__ = ["CoppeliaSimPlant", "CoppeliaSimScene"]
