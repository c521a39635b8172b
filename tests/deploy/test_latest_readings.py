"""Readings at the times of samples, also of samples that begin late."""

import pytest

from omnidrive import Pose
from omnidrive.deploy.latest_readings import LatestReadings
from omnidrive.estimation import PoseFix, SensorReadings


def readings(stamp, *fixes):
    """Return readings of wheels that turn by 1 rad/s, with fixes at some times."""
    fixes = tuple(PoseFix(at, Pose(at, 0.0, 0.0), 0.01, 0.01) for at in fixes)
    return SensorReadings(stamp, fixes=fixes, wheel_angles=(stamp, 2.0 * stamp))


def test_a_fix_after_the_deadline_of_a_late_sample_waits_for_the_next_one():
    latest = LatestReadings()
    latest.take(readings(5.0), 5.0, 5.0)
    latest.take(readings(5.13, 5.09, 5.12), 5.1, 5.14)  # 0.04 s late
    assert [fix.stamp for fix in latest.at(5.1, 0.0).fixes] == [5.09]
    latest.take(None, 5.2, 5.2)
    assert [fix.stamp for fix in latest.at(5.2, 0.0).fixes] == [5.12]
    latest.take(None, 5.3, 5.3)
    assert not latest.at(5.3, 0.0).fixes


def test_a_fix_of_a_clock_that_is_ahead_counts_as_taken_at_the_deadline():
    latest = LatestReadings()
    latest.take(readings(5.12, 5.12), 5.1, 5.1)
    assert [fix.stamp for fix in latest.at(5.1, 0.0).fixes] == [5.1]


@pytest.mark.parametrize(
    ("stamp", "read_at", "expected"),
    [
        (5.08, 5.1, 5.1),  # extrapolated
        (5.13, 5.14, 5.1),  # the sample is late: interpolated
        (5.13, 5.1, 5.13),  # the clock is ahead: as they are
    ],
)
def test_wheel_angles_are_those_of_the_deadline(stamp, read_at, expected):
    latest = LatestReadings()
    latest.take(readings(5.0), 5.0, 5.0)
    latest.take(readings(stamp), 5.1, read_at)
    assert latest.at(5.1, 0.0).wheel_angles == pytest.approx((expected, 2.0 * expected))


def test_speeds_that_encoders_do_not_resolve_move_no_angle():
    """A wheel at 0.05 rad/s: readings every 2 ms, whose angles are multiples of 1.5 mrad."""
    latest, step = LatestReadings(), 0.0015
    errors = []
    for number in range(200):
        stamp = 0.002 * number
        angle = step * int(0.05 * stamp / step)
        latest.take(SensorReadings(stamp, wheel_angles=(angle,)), stamp + 0.001, stamp + 0.001)
        (given,) = latest.at(stamp + 0.001, 0.0).wheel_angles
        errors.append(given - angle)
    settled = errors[10:]
    assert 0.0 < max(settled) < 0.2 * step  # by two readings alone: 0.5
    assert min(settled) == 0.0
