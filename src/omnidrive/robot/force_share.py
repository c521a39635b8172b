"""Shares of the forces of a robot, that friction and motors permit at equal loads of the wheels.

The rest of each share is the reserve of the next one: references need less than what governed
references use, those less than plans, and plans less than the wheels can exert, because the loads
of the wheels are unequal while the robot accelerates.
"""

from __future__ import annotations

from math import floor

PLANS = 0.8
"""Share that plans of the controller ``holonomic-nmpc`` use at most, its parameter ``traction``."""
GOVERNED = 0.965
"""Share of the forces in plans that governed references use; the rest is for feedback."""
REFERENCES = floor(100.0 * GOVERNED * PLANS) / 100.0
"""Share that references use which are timed within the limits of a robot: at most what governed
references use, so that the governor leaves them as they are."""
