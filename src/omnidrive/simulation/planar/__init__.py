"""The robot as a rigid body on the plane, with Coulomb traction at every wheel; compiled."""

from omnidrive.simulation.planar.plant import PlanarPlant
from omnidrive.simulation.planar.roll_out import roll_out

__all__ = ["PlanarPlant", "roll_out"]
