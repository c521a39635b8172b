"""Reference motions: desired pose and twist as functions of time."""

from omnidrive.reference.corridor import Corridor
from omnidrive.reference.limits import MotionLimits
from omnidrive.reference.minimum_time import MinimumTime, minimum_time
from omnidrive.reference.path_timing import Heading, time_within_limits
from omnidrive.reference.reference import Hold, Reference, Setpoint
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.timed_reference import TimedReference
from omnidrive.reference.uniform_reference import (
    UniformReference,
    shortest_duration,
    time_uniformly,
    wheel_speed_used,
)
from omnidrive.reference.waypoints import load_waypoints, save_waypoints

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
