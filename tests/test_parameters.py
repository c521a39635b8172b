"""Parameters built in Python are checked against their bounds, as those of files are."""

import re
from math import nan

import pytest
from pydantic import ValidationError

import omnidrive as od
from omnidrive.control import FeedforwardGains, HolonomicParameters
from omnidrive.control.pid import (
    MemorylessParameters,
    PidChannel,
    SelfTuningParameters,
    TrackingParameters,
    no_tuning,
)
from omnidrive.errors import InvalidInput, kind_of
from omnidrive.estimation import EstimatorSettings
from omnidrive.parameter import bounds_of, check_bounds, check_number
from omnidrive.reference.shapes import Circle

SMALL = od.named_robot("small")
CALLS = {
    "feedforward": (
        lambda: od.FeedforwardController(0.1, FeedforwardGains(heading=51.0)),
        "heading is 51 1/s, need 0 to 50 1/s",
    ),
    "published PID": (
        lambda: PidChannel(no_tuning, 0.1, MemorylessParameters(kp=-1.0)),
        "kp is -1 1/s, need 0 to 50 1/s",
    ),
    "PID of the paper": (
        lambda: PidChannel(no_tuning, 0.1, SelfTuningParameters(limit=0.0)),
        "limit is 0 m/s or rad/s, need 0.01 to 20 m/s or rad/s",
    ),
    "recommended PID": (
        lambda: PidChannel(no_tuning, 0.1, TrackingParameters(ki=nan)),
        "ki is nan 1/s^2, need 0 to 50 1/s^2",
    ),
    "NMPC": (
        lambda: od.holonomic_nmpc(
            SMALL.chassis, 0.1, parameters=HolonomicParameters(velocity_weight=0.0)
        ),
        "velocity_weight is 0 s^2/m^2, need 0.001 to 10000 s^2/m^2",
    ),
    "shape": (lambda: Circle(radius=1e9), "radius is 1e+09 m, need"),
}


@pytest.mark.parametrize("name", CALLS)
def test_parameters_out_of_bounds_are_refused(name):
    make, message = CALLS[name]
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()


@pytest.mark.parametrize("value", ["1", None, 1j, 10**5000], ids=kind_of)
def test_argument_that_is_no_number_is_refused(value):
    with pytest.raises(InvalidInput, match=r"^gain must be a number, got "):
        check_number("gain", value, od.Bounds(0.0, 1.0))


def test_parameters_in_a_scenario_are_checked():
    sensors = {"estimator": EstimatorSettings(false_alarms=7.0)}
    with pytest.raises(ValidationError, match=r"is 7, need 1e-09 to 0\.5"):
        od.paper_scenario().with_values(sensors=sensors)


@pytest.mark.parametrize(
    "parameters", [SelfTuningParameters(), MemorylessParameters(), TrackingParameters()]
)
def test_defaults_lie_within_bounds(parameters):
    assert list(bounds_of(type(parameters))) == list(parameters._fields)
    check_bounds(parameters)
