"""What the robot should do, as a function of time."""

from omnidrive.reference.reference import Hold, Reference, Setpoint
from omnidrive.reference.uniform import UniformReference, shortest_duration, time_uniformly

__all__ = [
    "Hold",
    "Reference",
    "Setpoint",
    "UniformReference",
    "shortest_duration",
    "time_uniformly",
]
