"""Names among which users choose in scenarios, options and arguments.

They stand here, and not beside the code that they select, so that the command line shows its help
without importing that code.
"""

from __future__ import annotations

from typing import Literal, get_args

PresetName = Literal["paper", "published-code", "recommended"]
"""Parameters of the controllers."""
TaskName = Literal["track", "noise", "step", "horizon", "faults"]
"""Tasks of a study."""
TimingName = Literal["uniform", "limits", "minimum-time"]
"""Laws of the timing along a path."""
Heading = Literal[
    "path", "tangent", "strafe-least", "fixed", "face", "goal-first", "goal-last", "fastest",
    "free",
]  # fmt: skip
"""Headings of a motion along a path.

``path``: those of the path; ``tangent``: the direction of travel; ``strafe-least``: near the
direction of travel, with smooth turns to the headings of the ends; ``fixed``: one heading;
``face``: toward a point; ``goal-first``, ``goal-last``: from the heading of the start to that of
the goal within a metre of the start or the goal; ``fastest``: the angle to the direction of travel
(steps of 15 degrees), the tangent, the path's headings or a fixed one, whichever takes the
shortest time; ``free``: optimised for time.
"""

TableHeading = Literal["tangent", "fixed"]
"""Direction of travel; along the x axis. Headings of a waypoint table that has none."""
FaultKind = Literal[
    "push", "slope", "payload", "patch", "wheel-dead", "wheel-locked", "wheel-weak", "encoder-dead",
    "pose-jump", "sensor-silent", "period-jitter", "solver-overrun",
]  # fmt: skip
"""Kinds of disturbances and faults."""

WAYPOINTS = "waypoints"
"""Name of the reference that reads a file."""
RobotFormat = Literal["urdf", "mjcf", "ros2_control"]
"""Formats from which a robot can be imported."""
Unknown = Literal["occupied", "free"]
"""Treatment of cells that a map file marks as unknown."""
MethodName = Literal["astar", "jump-point", "lazy-theta", "greedy"]
"""Methods of grid search."""
HeuristicName = Literal["octile", "manhattan", "euclidean", "zero"]
"""Heuristics of grid search."""
SmoothingName = Literal["spline", "certified"]
"""Methods of smoothing a grid path."""

Centroid = Literal["exact", "matlab"]
"""Computation of the centroid of a fuzzy set: closed form, or sums over samples."""
Reduction = Literal["centroid", "cos"]
"""Type reduction: centroid, or centre of sets."""
OutOfRange = Literal["clamp", "matlab", "raise"]
"""Policy for an input of a fuzzy system that is out of its range."""
NoRule = Literal["default", "raise"]
"""Policy of a fuzzy system if no rule fires."""
Algorithm = Literal["km", "ekm", "eiasc", "iasc", "nie-tan"]
"""Algorithms of type reduction."""
ALGORITHMS: tuple[Algorithm, ...] = get_args(Algorithm)
