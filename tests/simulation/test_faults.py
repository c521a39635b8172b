"""Faults: their schedule, and their text form on the command line."""

from contextlib import suppress
from itertools import pairwise
from math import hypot, pi
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.choices import FaultKind
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
from omnidrive.simulation.disturbances.schedule import sample_times
from tests.examples import examples

ROBOT = named_robot("paper")
REFERENCE = Hold(Pose(1.0, 2.0, 0.3), 100.0)
BEFORE = -1.0
FEW = examples(25)


def schedule(*texts):
    return Schedule(tuple(parse_fault(text) for text in texts), ROBOT)


def history(scheduled, dt=0.1, steps=100):
    """Return the disturbances at every sample."""
    times = [BEFORE, *(k * dt for k in range(steps))]
    return {t: scheduled.disturbances(b, t, REFERENCE) for b, t in pairwise(times)}


@FEW
@given(st.floats(0.0, 9.0), st.floats(0.2, 5.0), st.sampled_from([0.02, 0.1, 0.25]))
def test_fault_with_a_duration_acts_from_start_to_end(at, duration, dt):
    scheduled = schedule(f"wheel-dead:wheel=2,at={at!r},duration={duration!r}")
    for t, found in history(scheduled, dt, round(15.0 / dt)).items():
        inside = at - 1e-9 <= t < at + duration - 1e-9
        assert found == (Disturbances((0, 0, Motor.DEAD, 0)) if inside else Disturbances())


@FEW
@given(st.floats(0.0, 9.0), st.sampled_from([0.02, 0.1, 0.25]))
def test_impulses_and_offsets_act_once(at, dt):
    scheduled = schedule(f"push:at={at!r},speed=2,direction=0", f"pose-jump:at={at!r}")
    hits = [
        (t, c) for t, c in history(scheduled, dt, round(15.0 / dt)).items() if c != Disturbances()
    ]
    assert len(hits) == 1
    t, found = hits[0]
    assert at - 1e-9 <= t < at + dt
    assert found.impulse == pytest.approx((2.0 * ROBOT.mass, 0.0, 0.0))
    assert hypot(*found.offset[:2]) == pytest.approx(0.5)


def test_simultaneous_faults_are_combined():
    scheduled = schedule(
        "slope:angle=0.1,direction=0,at=0", "slope:angle=0.1,direction=3.141592653589793,at=0",
        "payload:at=0,share=0.1,x=1", "payload:at=0,share=0.3,x=-1",
        "wheel-weak:wheel=1,at=0", "wheel-locked:wheel=1,at=0", "patch:at=0,radius=0.4",
    )  # fmt: skip
    found = scheduled.disturbances(BEFORE, 0.0, REFERENCE)
    assert found.slope == pytest.approx((0.0, 0.0), abs=1e-15)
    assert found.payload.mass == pytest.approx(0.4 * ROBOT.mass)
    assert found.payload.x == pytest.approx(-0.5 * ROBOT.mean_wheel_distance)
    assert found.motors == (Motor.HEALTHY, Motor.LOCKED, Motor.HEALTHY, Motor.HEALTHY)
    assert found.patch[:3] == (1.0, 2.0, 0.4)  # the reference position


def test_faults_of_sensors_and_timing():
    scheduled = schedule(
        "encoder-dead:wheel=3,at=1", "sensor-silent:at=2,duration=1", "solver-overrun:at=4",
    )  # fmt: skip
    assert scheduled.plant_faults == ()
    assert scheduled.sensor_faults(0.9) == SensorFaults()
    assert scheduled.sensor_faults(2.5) == SensorFaults((3,), fixes_silent=True)
    assert scheduled.sensor_faults(3.0) == SensorFaults((3,))
    assert [scheduled.overrun(t) for t in (3.9, 4.0, 5.9, 6.0)] == [False, True, True, False]


def test_sample_times_without_jitter_are_multiples():
    dt = 0.1
    samples = list(sample_times(2.0, dt, [parse_fault("push:at=1")]))
    assert samples == [(k * dt, dt, k == 20) for k in range(21)]


@FEW
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.9))
def test_jitter_is_within_its_spread_and_preserves_the_duration(seed, spread):
    jitter = parse_fault(f"period-jitter:at=1,duration=3,spread={spread!r}")
    times, steps, is_last = zip(
        *sample_times(6.0, 0.1, [jitter], np.random.default_rng(seed)), strict=True
    )
    assert np.add(times[:-1], steps[:-1]) == pytest.approx(times[1:], abs=1e-12)
    assert all(0.1 * (1 - spread) - 1e-12 <= h <= 0.1 * (1 + spread) + 1e-12 for h in steps)
    jittered = [h != 0.1 for t, h in zip(times, steps, strict=True) if 1.0 <= t < 4.0]
    assert np.mean(jittered) > 0.9
    assert not any(h != 0.1 for t, h in zip(times, steps, strict=True) if not 1.0 <= t < 4.0)
    assert list(is_last) == [False] * (len(is_last) - 1) + [True]
    assert abs(times[-1] - 6.0) <= 0.051


def test_the_same_seed_gives_the_same_jitter():
    jitter = parse_fault("period-jitter:at=0")
    one, same, other = (
        list(sample_times(5.0, 0.1, [jitter], np.random.default_rng(seed))) for seed in (1, 1, 2)
    )
    assert one == same != other


def test_fault_after_the_end_is_rejected():
    scheduled = schedule("push:at=20")
    with pytest.raises(InvalidInput, match="push begins at 20 s, but the run ends at 20 s"):
        scheduled.check(20.0)
    scheduled.check(20.1)


def test_unknown_wheel_is_rejected():
    with pytest.raises(InvalidInput, match="no wheel 4; robot paper has the wheels 0 to 3"):
        schedule("wheel-dead:wheel=4")


def test_default_faults_contain_every_kind():
    assert [fault.kind for fault in default_faults(2.0)] == list(FAULTS)
    assert {fault.at for fault in default_faults(2.0)} == {2.0}


@pytest.mark.parametrize("kind", FAULTS)
def test_every_kind_is_parsed_with_its_defaults(kind):
    assert parse_fault(kind) == parse_fault(f" {kind} : at = 5 ") == FAULTS[kind]()


def test_values_are_parsed():
    found = parse_fault("slope:angle=0.2,direction=-1.5,at=1e1,duration=3")
    assert (found.angle, found.direction, found.at, found.duration) == (0.2, -1.5, 10.0, 3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "there is no fault ''; there are push, slope"),
        ("puhs", "did you mean 'push'"),
        ("push:spede=1", "no 'spede'; there are at, speed, direction; did you mean 'speed'"),
        ("push:speed", "'speed' is not NAME=VALUE, such as at=5"),
        ("wheel-dead:wheel=1.5", "wheel: input should be a valid integer"),
        ("push:speed=fast", "speed must be a plain number, got 'fast'"),
        ("push:speed=1 m/s", "speed must be a plain number"),
        ("push:speed=nan", "speed must be a plain number, got 'nan'"),
        ("push:speed=11", "speed is 11 m/s, need 0 to 10 m/s"),
        ("push:at=inf", "at must be a plain number, got 'inf'"),
        ("push:at=1_0", "at must be a plain number, got '1_0'"),
        ("push:at=-1", "at is -1 s, need 0 to 36000 s"),
        ("push:at=1,at=2", "'at' is given twice"),
        ("push:kind=1", "there is no 'kind'"),
        ("wheel-dead:wheel=-1", "wheel is -1, need 0 to 63"),
        ("push:" + "a" * 500, "at most 200 characters"),
        ("pa\x1b[31mtch", "no fault 'pa?"),
    ],
)
def test_invalid_text_is_rejected_with_a_message(text, message):
    with pytest.raises(InvalidInput) as caught:
        parse_fault(text)
    assert message in str(caught.value)
    assert "\x1b" not in str(caught.value)


@FEW
@given(st.text(max_size=250))
def test_any_text_is_parsed_or_rejected(text):
    with suppress(InvalidInput):
        assert parse_fault(text).kind in FAULTS


def test_slope_direction_is_a_bearing_in_w():
    found = schedule(f"slope:at=0,angle=0.1,direction={pi / 2}").disturbances(
        BEFORE, 0.0, REFERENCE
    )
    assert found.slope == pytest.approx((0.0, np.tan(0.1)), abs=1e-12)


def test_kinds_in_options_are_those_that_exist():
    assert tuple(FAULTS) == get_args(FaultKind)
    assert tuple(fault.model_fields["kind"].default for fault in FAULTS.values()) == tuple(FAULTS)
