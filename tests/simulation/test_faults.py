"""Faults: what holds when, and how they are written on a command line."""

from contextlib import suppress
from itertools import pairwise
from math import hypot, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    FAULTS,
    Disturbances,
    Motor,
    Schedule,
    SensorFaults,
    default_faults,
    parse_fault,
)

ROBOT = named_robot("paper")
PLACE = Hold(Pose(1.0, 2.0, 0.3), 100.0)
BEFORE = -1.0
few = settings(max_examples=25, deadline=None)


def schedule(*texts):
    return Schedule(tuple(parse_fault(text) for text in texts), ROBOT)


def history(plan, dt=0.1, steps=100):
    """Conditions at every sample."""
    times = [BEFORE, *(k * dt for k in range(steps))]
    return {t: plan.disturbances(b, t, PLACE) for b, t in pairwise(times)}


@few
@given(st.floats(0.0, 9.0), st.floats(0.2, 5.0), st.sampled_from([0.02, 0.1, 0.25]))
def test_what_lasts_holds_from_its_beginning_to_its_end(at, duration, dt):
    plan = schedule(f"wheel-dead:wheel=2,at={at!r},duration={duration!r}")
    for t, found in history(plan, dt, round(15.0 / dt)).items():
        inside = at - 1e-9 <= t < at + duration - 1e-9
        assert found == (Disturbances((0, 0, Motor.DEAD, 0)) if inside else Disturbances())


@few
@given(st.floats(0.0, 9.0), st.sampled_from([0.02, 0.1, 0.25]))
def test_what_is_at_once_happens_once(at, dt):
    plan = schedule(f"push:at={at!r},speed=2,direction=0", f"pose-jump:at={at!r}")
    hits = [(t, c) for t, c in history(plan, dt, round(15.0 / dt)).items() if c != Disturbances()]
    assert len(hits) == 1
    t, found = hits[0]
    assert at - 1e-9 <= t < at + dt
    assert found.impulse == pytest.approx((2.0 * ROBOT.mass, 0.0, 0.0))
    assert hypot(*found.offset[:2]) == pytest.approx(0.5)


def test_what_holds_at_one_time_adds_up():
    plan = schedule(
        "slope:angle=0.1,direction=0,at=0", "slope:angle=0.1,direction=3.141592653589793,at=0",
        "payload:at=0,share=0.1,x=1", "payload:at=0,share=0.3,x=-1",
        "wheel-weak:wheel=1,at=0", "wheel-locked:wheel=1,at=0", "patch:at=0,radius=0.4",
    )  # fmt: skip
    found = plan.disturbances(BEFORE, 0.0, PLACE)
    assert found.slope == pytest.approx((0.0, 0.0), abs=1e-15)
    assert found.payload.mass == pytest.approx(0.4 * ROBOT.mass)
    assert found.payload.x == pytest.approx(-0.5 * ROBOT.mean_wheel_distance)
    assert found.motors == (Motor.HEALTHY, Motor.LOCKED, Motor.HEALTHY, Motor.HEALTHY)
    assert found.patch[:3] == (1.0, 2.0, 0.4)  # where the robot shall be


def test_sensors_and_timing():
    plan = schedule(
        "encoder-dead:wheel=3,at=1", "sensor-silent:at=2,duration=1", "solver-overrun:at=4",
    )  # fmt: skip
    assert plan.plant_faults == ()
    assert plan.sensor_faults(0.9) == SensorFaults()
    assert plan.sensor_faults(2.5) == SensorFaults((3,), fixes_silent=True)
    assert plan.sensor_faults(3.0) == SensorFaults((3,))
    assert [plan.overrun(t) for t in (3.9, 4.0, 5.9, 6.0)] == [False, True, True, False]


def test_without_jitter_time_is_counted():
    dt = 0.1
    samples = list(schedule("push:at=1").samples(2.0, dt))
    assert samples == [(k * dt, dt, k == 20) for k in range(21)]


@few
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.9))
def test_jitter_stays_within_its_spread_and_the_run_within_its_duration(seed, spread):
    plan = schedule(f"period-jitter:at=1,duration=3,spread={spread!r}")
    times, steps, ends = zip(*plan.samples(6.0, 0.1, np.random.default_rng(seed)), strict=True)
    assert np.add(times[:-1], steps[:-1]) == pytest.approx(times[1:], abs=1e-12)
    assert all(0.1 * (1 - spread) - 1e-12 <= h <= 0.1 * (1 + spread) + 1e-12 for h in steps)
    drawn = [h != 0.1 for t, h in zip(times, steps, strict=True) if 1.0 <= t < 4.0]
    assert np.mean(drawn) > 0.9
    assert not any(h != 0.1 for t, h in zip(times, steps, strict=True) if not 1.0 <= t < 4.0)
    assert list(ends) == [False] * (len(ends) - 1) + [True]
    assert abs(times[-1] - 6.0) <= 0.051


def test_the_same_seed_gives_the_same_jitter():
    plan = schedule("period-jitter:at=0")
    one, same, other = (
        list(plan.samples(5.0, 0.1, np.random.default_rng(seed))) for seed in (1, 1, 2)
    )
    assert one == same != other


def test_a_fault_after_the_end_is_refused():
    plan = schedule("push:at=20")
    with pytest.raises(InvalidInput, match="push begins at 20 s, but the run ends at 20 s"):
        plan.check(20.0)
    plan.check(20.1)


def test_a_wheel_that_is_not_there_is_refused():
    with pytest.raises(InvalidInput, match="no wheel 4; robot paper has the wheels 0 to 3"):
        schedule("wheel-dead:wheel=4")


def test_there_is_a_default_for_every_kind():
    assert [fault.kind for fault in default_faults(2.0)] == list(FAULTS)
    assert {fault.at for fault in default_faults(2.0)} == {2.0}


@pytest.mark.parametrize("kind", FAULTS)
def test_every_kind_is_read_with_its_defaults(kind):
    assert parse_fault(kind) == parse_fault(f" {kind} : at = 5 ") == FAULTS[kind]()


def test_values_are_read():
    found = parse_fault("slope:angle=0.2,direction=-1.5,at=1e1,duration=3")
    assert (found.angle, found.direction, found.at, found.duration) == (0.2, -1.5, 10.0, 3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "there is no fault ''; there are push, slope"),
        ("puhs", "did you mean 'push'"),
        ("push:spede=1", "no 'spede'; there are at, speed, direction; did you mean 'speed'"),
        ("push:speed", "'speed' is not NAME=VALUE, such as at=5"),
        ("push:speed=fast", "speed must be a plain number, got 'fast'"),
        ("push:speed=1 m/s", "speed must be a plain number"),
        ("push:speed=nan", "speed must be a plain number, got 'nan'"),
        ("push:speed=11", "speed is 11 m/s, need 0 to 10 m/s"),
        ("push:speed=nan", "speed"),
        ("push:at=inf", "at"),
        ("push:at=-1", "at is -1 s, need 0 to 36000 s"),
        ("push:at=1,at=2", "'at' is given twice"),
        ("push:kind=1", "there is no 'kind'"),
        ("wheel-dead:wheel=1.5", "wheel"),
        ("wheel-dead:wheel=-1", "wheel is -1, need 0 to 63"),
        ("push:" + "a" * 500, "at most 200 characters"),
        ("pa\x1b[31mtch", "no fault 'pa?"),
    ],
)
def test_what_makes_no_sense_is_refused(text, message):
    with pytest.raises(InvalidInput) as caught:
        parse_fault(text)
    assert message in str(caught.value)
    assert "\x1b" not in str(caught.value)


@few
@given(st.text(max_size=250))
def test_any_text_is_a_fault_or_refused(text):
    with suppress(InvalidInput):
        assert parse_fault(text).kind in FAULTS


def test_directions_are_bearings_in_w():
    found = schedule(f"slope:at=0,angle=0.1,direction={pi / 2}").disturbances(BEFORE, 0.0, PLACE)
    assert found.slope == pytest.approx((0.0, np.tan(0.1)), abs=1e-12)
