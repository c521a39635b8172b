"""What the robot should do, as a function of time."""

from omnidrive.reference.reference import Hold, Reference, Setpoint
from omnidrive.reference.sampled import SampledReference
from omnidrive.reference.uniform import UniformReference, shortest_duration, time_uniformly
from omnidrive.reference.waypoints import load_waypoints, save_waypoints

__all__ = [
    "Hold",
    "Reference",
    "SampledReference",
    "Setpoint",
    "UniformReference",
    "load_waypoints",
    "save_waypoints",
    "shortest_duration",
    "time_uniformly",
]
