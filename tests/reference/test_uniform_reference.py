"""Uniform references: against the reference data, and invariants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidReference
from omnidrive.geometry import BodyTwist, WorldTwist, to_body
from omnidrive.reference import (
    Hold,
    Reference,
    UniformReference,
    shortest_duration,
    time_uniformly,
    wheel_speed_used,
)
from omnidrive.robot import named_robot
from omnidrive.scenario import paper_scenario, plan_and_check
from tests.shared_data import shared_table

PREPARED = plan_and_check(paper_scenario())


@pytest.mark.parametrize("duration", [20.0, 30.0])
def test_paper_references(duration):
    theirs = shared_table(f"reference/ref_paper_T{duration:.0f}.csv")
    window = PREPARED.reference(duration).window(0.0, len(theirs), 0.1)
    assert window[:, :3] == pytest.approx(theirs[:, 1:4], abs=1e-6)
    speed, yaw_rate = np.hypot(window[:, 3], window[:, 4]), window[:, 5]
    assert speed == pytest.approx(theirs[:, 4], abs=1e-6)
    assert yaw_rate == pytest.approx(theirs[:, 5], abs=1e-6)


@given(t=st.floats(0.01, 19.99))
def test_velocity_is_the_derivative_of_the_pose(t):
    reference, h = PREPARED.reference(20.0), 1e-5
    ahead, behind = (np.array(reference.at(t + s).pose) for s in (h, -h))
    assert (ahead - behind) / (2 * h) == pytest.approx(np.array(reference.at(t).twist), abs=1e-4)


@pytest.mark.parametrize("t", [-1.0, 20.1, 100.0])
def test_reference_is_at_rest_outside_its_duration(t):
    reference = PREPARED.reference(20.0)
    setpoint = reference.at(t)
    assert setpoint.twist == WorldTwist(0.0, 0.0, 0.0)
    assert setpoint.pose == reference.at(0.0 if t < 0 else 20.0).pose


@given(t=st.floats(-1, 25), n=st.integers(1, 40))
def test_window_matches_setpoints(t, n):
    for reference in (PREPARED.reference(20.0), Hold(PREPARED.reference(20.0).at(3.0).pose, 5.0)):
        assert isinstance(reference, Reference)
        window = reference.window(t, n, 0.1)
        rows = [(*s.pose, *s.twist) for s in (reference.at(t + 0.1 * k) for k in range(n))]
        assert window == pytest.approx(np.array(rows), abs=1e-9)


def test_wheel_reaches_its_limit_at_shortest_duration():
    chassis = named_robot("paper").chassis
    shortest = shortest_duration(PREPARED.path, chassis)
    reference = UniformReference(PREPARED.path, shortest)
    peak = 0.0
    for t in np.linspace(0.0, shortest, 4001):
        pose, twist = reference.at(t)
        peak = max(peak, np.abs(chassis.wheel_speeds(to_body(twist, pose.yaw))).max())
    assert peak <= chassis.max_wheel_speed
    assert peak >= 0.98 * chassis.max_wheel_speed  # rounded up to 0.1 s


def test_wheel_speed_used_is_that_of_the_fastest_wheel():
    chassis, duration = PREPARED.robot.chassis, 25.0
    reference = UniformReference(PREPARED.path, duration)
    peak = max(
        float(np.abs(chassis.wheel_speeds(to_body(setpoint.twist, setpoint.pose.yaw))).max())
        for setpoint in map(reference.at, np.linspace(0.0, duration, 4001))
    )
    used = wheel_speed_used(PREPARED.path, duration, chassis)
    assert used == pytest.approx(peak / chassis.max_wheel_speed, rel=1e-3)
    assert wheel_speed_used(PREPARED.path, 50.0, chassis) == pytest.approx(0.5 * used)


def test_message_of_too_short_duration_gives_the_shortest():
    chassis = named_robot("paper").chassis
    shortest = shortest_duration(PREPARED.path, chassis)
    time_uniformly(PREPARED.path, shortest, chassis)
    with pytest.raises(InvalidReference, match=f"shortest duration is {shortest:g} s"):
        time_uniformly(PREPARED.path, shortest - 0.1, chassis)


@pytest.mark.parametrize("duration", [0.0, -3.0, np.nan, np.inf])
def test_duration_must_be_positive(duration):
    with pytest.raises(InvalidReference, match="must be positive"):
        UniformReference(PREPARED.path, duration)


def test_integrated_body_twist_follows_the_reference():
    """The middle of the spline is straight along x, without sideways motion."""
    pose, twist = PREPARED.reference(20.0).at(5.0)
    body: BodyTwist = to_body(twist, pose.yaw)
    assert body.vy == pytest.approx(0.0, abs=0.05)
    assert body.vx > 0.3
