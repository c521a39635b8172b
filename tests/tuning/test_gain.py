"""Gain on the held-out runs: paired, with intervals, by hand."""

import numpy as np
import pytest

from omnidrive.evaluation.statistics.mean_test import difference_tests
from omnidrive.tuning import held_out_gain, parse_objective
from omnidrive.tuning.gain import Gain
from tests.tuning.synthetic import record

RNG = np.random.default_rng(5)
BEFORE = 0.04 + 0.002 * RNG.normal(size=(6, 3))  # m; repetitions, references
AFTER = 0.7 * BEFORE + 0.0005 * RNG.normal(size=(6, 3))


def runs(values, *, lost=()):
    return [
        record(k, repetition=k // 3, finished=k not in lost, me=me, wheel_acceleration=10.0)
        for k, me in enumerate(values.ravel())
    ]


def test_paired_by_repetition():
    found = held_out_gain(runs(BEFORE), runs(AFTER), [parse_objective("me + 0.1*effort")])
    assert [each.label for each in found.gains] == [
        "ME in mm + 0.1 × effort in rad/s²", "ME, mm", "effort, rad/s²",
    ]  # fmt: skip
    gain = found.gains[1]
    means = 1e3 * BEFORE.mean(axis=1), 1e3 * AFTER.mean(axis=1)
    (expected,) = difference_tests((means[1] - means[0])[:, None])
    assert gain.difference == pytest.approx(expected.estimate)
    assert gain.difference.mean == pytest.approx((means[1] - means[0]).mean())
    assert gain.relative[0] == pytest.approx(-0.3, abs=0.02)
    assert gain.verdict == "better"
    assert found.gains[2].verdict == "no difference shown"
    assert gain.text == ("ME, mm: 39.69 before, 27.6 after tuning, −30.5 % [−31.2 %, −29.5 %]")
    assert (found.runs, found.failed_before, found.failed_after) == (18, 0, 0)


def test_pairs_with_a_lost_run_are_left_out_and_counted():
    found = held_out_gain(runs(BEFORE, lost={0}), runs(AFTER, lost={4, 5}), [parse_objective("me")])
    assert (found.failed_before, found.failed_after) == (1, 2)
    kept = np.ones(18, dtype=bool)
    kept[[0, 4, 5]] = False
    means = [
        np.mean((1e3 * BEFORE.ravel())[3 * k : 3 * k + 3][kept[3 * k : 3 * k + 3]])
        for k in range(6)
    ]
    assert found.gains[0].before == pytest.approx(np.mean(means))


def test_a_metric_is_reported_once():
    found = held_out_gain(runs(BEFORE), runs(AFTER), [parse_objective("effort")])
    assert [each.label for each in found.gains] == ["effort in rad/s²", "ME, mm"]


def test_single_repetition_compares_references():
    found = held_out_gain(runs(BEFORE[:1]), runs(AFTER[:1]), [parse_objective("me")])
    assert found.gains[0].difference.sample_size == 3


def test_no_change_and_no_runs():
    same = held_out_gain(runs(BEFORE), runs(BEFORE), [parse_objective("me")])
    assert {each.verdict for each in same.gains} == {"no difference shown"}
    lost = held_out_gain(runs(BEFORE, lost=range(18)), runs(AFTER), [parse_objective("me")])
    assert lost.gains == ()
    assert lost.failed_before == 18
    assert isinstance(same.gains[0], Gain)
