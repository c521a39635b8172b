"""Step-response figures compared with python-control."""

from math import isnan

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.evaluation import step_response
from tests.examples import examples


def second_order(damping, rate, t):
    """Return the unit step response of a second-order system with damping below 1."""
    w = rate * np.sqrt(1 - damping**2)
    return 1 - np.exp(-damping * rate * t) * (np.cos(w * t) + damping * rate / w * np.sin(w * t))


@examples(30)
@given(
    damping=st.floats(0.15, 0.95),
    rate=st.floats(1.0, 6.0),
    start=st.floats(-3, 3),
    size=st.sampled_from([-2.0, -0.3, 0.5, 1.0]),
)
def test_agrees_with_python_control(damping, rate, start, size):
    t = np.arange(0.0, 30.0, 0.001)
    y = second_order(damping, rate, t)
    expected = control.step_info(y, T=t, yfinal=1.0, SettlingTimeThreshold=0.1)
    actual = step_response(t, start + size * y, start, start + size)
    assert actual.overshoot == pytest.approx(expected["Overshoot"], abs=1e-6)
    assert actual.rise_time == pytest.approx(expected["RiseTime"], abs=2.1e-3)
    assert actual.settling_time == pytest.approx(expected["SettlingTime"], abs=2.1e-3)


def test_samples_are_interpolated_linearly():
    t = np.array([0.0, 1.0, 2.0])
    response = step_response(t, np.array([0.0, 1.0, 1.0]), 0.0, 1.0)
    assert response.overshoot == 0.0
    assert response.rise_time == pytest.approx(0.8, abs=2e-3)
    assert response.settling_time == pytest.approx(0.9, abs=2e-3)


def test_times_are_nan_if_levels_are_not_reached():
    t = np.linspace(0, 5, 51)
    response = step_response(t, 0.5 * np.ones(51), 0.0, 1.0)
    assert isnan(response.rise_time)
    assert isnan(response.settling_time)
