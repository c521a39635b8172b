"""What the robot should do, as a function of time."""

from omnidrive.reference.corridor import Corridor
from omnidrive.reference.limits import MotionLimits
from omnidrive.reference.minimum_time import MinimumTime, minimum_time
from omnidrive.reference.reference import Hold, Reference, Setpoint
from omnidrive.reference.sampled import SampledReference
from omnidrive.reference.timed import TimedReference
from omnidrive.reference.uniform import (
    UniformReference,
    shortest_duration,
    time_uniformly,
    wheel_speed_used,
)
from omnidrive.reference.waypoints import load_waypoints, save_waypoints
from omnidrive.reference.within_limits import Heading, time_within_limits

__all__ = [
    "Corridor",
    "Heading",
    "Hold",
    "MinimumTime",
    "MotionLimits",
    "Reference",
    "SampledReference",
    "Setpoint",
    "TimedReference",
    "UniformReference",
    "load_waypoints",
    "minimum_time",
    "save_waypoints",
    "shortest_duration",
    "time_uniformly",
    "time_within_limits",
    "wheel_speed_used",
]
