"""Reference motions: desired pose and twist of B in W as functions of time.

All of them satisfy the protocol :class:`Reference`:

- :class:`Hold`: a constant pose;
- :class:`SampledReference`: cubic interpolation of timed samples;
- :class:`ShapeReference`: a shape, such as :class:`Circle`, in a given duration;
- :class:`UniformReference`: a spline path, its parameter proportional to time;
- :class:`TimedReference`: a path, timed within limits of speed and acceleration;
- :class:`SmoothReference`: a path, timed within limits of speed, acceleration and jerk;
- :class:`RetimedReference`: another reference, uniformly slower or faster;
- :class:`DelayedReference`: another reference, slower only where limits require it;
- :class:`SplicedReference`: one reference, and from a given time on another one.
"""

from omnidrive.choices import Heading
from omnidrive.reference.components import ReferenceContext
from omnidrive.reference.delay_within_limits import delay_within_limits, needed_limits
from omnidrive.reference.delayed_reference import DelayedReference
from omnidrive.reference.headings.heading_sections import HeadingSection
from omnidrive.reference.limit_sampling import sample_within_limits
from omnidrive.reference.limit_usage import limit_usage, shortest_duration_within, slowed_to
from omnidrive.reference.path_optimisation.corridor import Corridor
from omnidrive.reference.path_optimisation.minimum_time import MinimumTime, minimum_time
from omnidrive.reference.reference import Hold, Reference, Setpoint
from omnidrive.reference.reference_path import ReferencePath
from omnidrive.reference.retimed_reference import RetimedReference
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.shape_reference import ShapeReference
from omnidrive.reference.shapes import Circle, Eight, RaisedCosine, RandomSmooth, Slalom, Square
from omnidrive.reference.spliced_reference import SplicedReference
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import LimitRows, MotionLimits, limit_rows
from omnidrive.reference.timing.path_timing import time_within_limits
from omnidrive.reference.timing.smooth_reference import SmoothReference
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.uniform_reference import (
    UniformReference,
    shortest_duration,
    time_uniformly,
    top_speed,
    wheel_speed_used,
)
from omnidrive.reference.waypoint_motion import (
    ConvexPolygon,
    Disc,
    MotionProblem,
    MotionSection,
    MotionWaypoint,
    WaypointMotion,
    load_motion_problem,
    minimum_time_through,
)
from omnidrive.reference.waypoint_reference import spline_along, waypoint_reference
from omnidrive.reference.waypoints import load_waypoints, save_waypoints

__all__ = [
    "Circle",
    "ConvexPolygon",
    "Corridor",
    "DelayedReference",
    "Disc",
    "Eight",
    "Heading",
    "HeadingSection",
    "Hold",
    "LimitRows",
    "LimitedReference",
    "MinimumTime",
    "MotionLimits",
    "MotionProblem",
    "MotionSection",
    "MotionWaypoint",
    "RaisedCosine",
    "RandomSmooth",
    "Reference",
    "ReferenceContext",
    "ReferencePath",
    "RetimedReference",
    "SampledReference",
    "Setpoint",
    "ShapeReference",
    "Slalom",
    "SmoothReference",
    "SplicedReference",
    "Square",
    "TimedReference",
    "UniformReference",
    "WaypointMotion",
    "delay_within_limits",
    "limit_rows",
    "limit_usage",
    "load_motion_problem",
    "load_waypoints",
    "minimum_time",
    "minimum_time_through",
    "needed_limits",
    "sample_within_limits",
    "save_waypoints",
    "shortest_duration",
    "shortest_duration_within",
    "slowed_to",
    "spline_along",
    "time_uniformly",
    "time_within_limits",
    "top_speed",
    "waypoint_reference",
    "wheel_speed_used",
]
