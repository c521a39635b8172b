"""Step-response figures against python-control's."""

from math import isnan

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.evaluation import step_response


def second_order(damping, rate, t):
    """Unit step response of a second-order system, any damping below 1."""
    w = rate * np.sqrt(1 - damping**2)
    return 1 - np.exp(-damping * rate * t) * (np.cos(w * t) + damping * rate / w * np.sin(w * t))


@settings(max_examples=30, deadline=None)
@given(
    damping=st.floats(0.15, 0.95),
    rate=st.floats(1.0, 6.0),
    start=st.floats(-3, 3),
    size=st.sampled_from([-2.0, -0.3, 0.5, 1.0]),
)
def test_agrees_with_python_control(damping, rate, start, size):
    t = np.arange(0.0, 30.0, 0.001)
    y = second_order(damping, rate, t)
    theirs = control.step_info(y, T=t, yfinal=1.0, SettlingTimeThreshold=0.1)
    ours = step_response(t, start + size * y, start, start + size)
    assert ours.overshoot == pytest.approx(theirs["Overshoot"], abs=1e-6)
    assert ours.rise_time == pytest.approx(theirs["RiseTime"], abs=2.1e-3)
    assert ours.settling_time == pytest.approx(theirs["SettlingTime"], abs=2.1e-3)


def test_coarse_samples_are_joined_by_straight_lines():
    t = np.array([0.0, 1.0, 2.0])
    response = step_response(t, np.array([0.0, 1.0, 1.0]), 0.0, 1.0)
    assert response.overshoot == 0.0
    assert response.rise_time == pytest.approx(0.8, abs=2e-3)
    assert response.settling_time == pytest.approx(0.9, abs=2e-3)


def test_a_response_that_never_arrives_has_no_times():
    t = np.linspace(0, 5, 51)
    response = step_response(t, 0.5 * np.ones(51), 0.0, 1.0)
    assert isnan(response.rise_time)
    assert isnan(response.settling_time)
