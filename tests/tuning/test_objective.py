"""Objectives and limits: parsed, with units, never evaluated."""

from math import inf, nan

import pytest

from omnidrive.errors import InvalidInput
from omnidrive.tuning import parse_limit, parse_objective
from tests.tuning.synthetic import record

RUNS = [
    record(0, me=0.02, wheel_acceleration=10.0, min_clearance=0.1),
    record(1, me=0.04, wheel_acceleration=30.0, min_clearance=-0.1),
]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("me", 30.0),
        ("me + 0.1*effort", 32.0),
        ("me+effort*0.1", 32.0),
        ("2*me[m]", 0.06),
        ("max(me)", 40.0),
        ("mean( me ) + max(effort)", 60.0),
        ("me - min_clearance", 30.0),
        ("1e-1*effort", 2.0),
    ],
)
def test_value(text, value):
    assert parse_objective(text).value(RUNS) == pytest.approx(value)


def test_text_names_units():
    assert str(parse_objective("me+0.1*effort")) == "ME in mm + 0.1 × effort in rad/s²"


def test_missing_metrics_are_infinite():
    assert parse_objective("mae").value(RUNS) == inf
    assert parse_objective("max(me)").value([*RUNS, record(2, me=nan)]) == inf


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not a sum"),
        ("me +", "is not a sum"),
        ("me effort", "is not a sum"),
        ("me*effort", "is not a sum"),
        ("max(me", "is not a sum"),
        ("me)", "is not a sum"),
        ("__import__('os').system('true')", "there is no metric '__import__'"),
        ("me if me else me", "is not a sum"),
        ("mee", "did you mean 'me'"),
        ("me[s]", "not a unit of me"),
        ("0*me", "need another number than 0"),
        ("1e999*me", "need another number than 0"),
        ("me - effort", "its weight must be positive"),
        ("min_clearance", "its weight must be negative"),
        ("me + me", "contains a metric twice"),
        ("+".join(["me"] * 200), "at most 300 characters"),
    ],
)
def test_bad_objectives_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_objective(text)


def test_limits():
    upper, lower = parse_limit("me <= 30mm"), parse_limit("min_clearance>=0.05m")
    assert [upper.violation(each) for each in RUNS] == pytest.approx([0.0, 1.0 / 3.0])
    assert [lower.violation(each) for each in RUNS] == pytest.approx([0.0, 3.0])
    assert parse_limit("collisions<=0").violation(record(0, collisions=2.0)) > 1.0
    assert upper.violation(record(0)) == inf


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("me < 1mm", "is not a limit"),
        ("me", "is not a limit"),
        ("me <= 30", "needs a unit, such as 30mm"),
        ("me <= 30s", "not a unit of me"),
        ("me <= x", "is not a value of me"),
        ("mi <= 1mm", "there is no metric 'mi'"),
    ],
)
def test_bad_limits_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_limit(text)
