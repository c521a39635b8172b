"""Fastest motion along the planned path of a scenario."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from omnidrive.planning import FootprintPlan, SplinePath
from omnidrive.reference import LimitedReference, MotionLimits, minimum_time, time_within_limits
from omnidrive.robot import Robot
from omnidrive.scenario.path_planning import ScenarioPlan
from omnidrive.scenario.scenario import Scenario


def motion_limits(scenario: Scenario, robot: Robot) -> MotionLimits:
    """Return the limits of the section `timing`."""
    timing = scenario.timing
    limits = MotionLimits.of_robot(robot, share=timing.traction, max_speed=timing.max_speed)
    return replace(
        limits,
        wheel_acceleration=timing.wheel_acceleration or inf,
        jerk=timing.max_jerk or inf,
        yaw_jerk=timing.max_yaw_jerk or inf,
    )


def fastest_motion(
    scenario: Scenario, robot: Robot, plan_: ScenarioPlan, time_limit: float | None
) -> tuple[SplinePath, LimitedReference | None, str]:
    """Return the path, the fastest motion along it, and the note on the timing.

    With the timing `uniform` the motion is None; with `minimum-time` the path is the optimised one.
    """
    timing, chassis = scenario.timing, robot.chassis
    if timing.law == "uniform":
        return plan_.spline, None, ""
    limits = motion_limits(scenario, robot)
    assert scenario.start is not None
    assert scenario.goal is not None
    if timing.law == "minimum-time":
        is_polygon = isinstance(plan_, FootprintPlan) and plan_.shape == "polygon"
        result = minimum_time(
            plan_.spline,
            chassis,
            limits,
            plan_.free_space,
            start_yaw=scenario.start.yaw,
            goal_yaw=scenario.goal.yaw,
            footprint=np.array(robot.outline) if is_polygon else None,
            time_limit=time_limit,
        )
        return result.path, result.reference, f"{result.status}: {result.message}"
    reference = time_within_limits(
        plan_.spline,
        chassis,
        limits,
        heading=timing.heading,
        start_yaw=scenario.start.yaw,
        goal_yaw=scenario.goal.yaw,
        zones=plan_.costs,
        target=timing.target,
    )
    return plan_.spline, reference, ""
