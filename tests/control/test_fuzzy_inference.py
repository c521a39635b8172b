"""The fuzzy systems, against stored references, brute force and their own laws."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.control.pid import INPUT_SETS, OUTPUT_SETS, Footprint, fuzzy_tuner
from omnidrive.control.pid.centroid import exact_centroid
from omnidrive.control.pid.rules import LABELS, paper_rules, published_rules
from omnidrive.control.pid.sets import CRISP, lagged, sampled
from omnidrive.control.pid.type1 import (
    SAMPLES,
    ExactType1,
    SampledType1,
    exact_type1,
    sampled_type1,
)
from omnidrive.control.pid.type2 import (
    CentreOfSetsType2,
    CentroidType2,
    centre_of_sets_type2,
    centroid_type2,
)
from omnidrive.control.pid.type_reduction import karnik_mendel, set_centroids
from tests.shared_data import shared, shared_table

FOOTPRINT = Footprint(scale=1.0, lag=0.3)
RULES = published_rules()

relaxed = settings(deadline=None)  # the first call compiles
inputs = st.floats(-1.0, 1.0)
heights = st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7).filter(lambda h: max(h) > 1e-6)


def sampled_centroids(footprint):
    lower = sampled(lagged(OUTPUT_SETS, footprint), SAMPLES, footprint.scale)
    upper = sampled(OUTPUT_SETS, SAMPLES, 1.0)
    ends = [karnik_mendel(SAMPLES, *pair) for pair in zip(lower, upper, strict=True)]
    return np.ascontiguousarray(np.transpose(ends))


def ends(interval):
    """Columns of the references: the middles, then least and greatest of each gain in turn."""
    pairs = np.transpose(interval)
    return [*pairs.mean(axis=1), *pairs.ravel()]


EXACT = ExactType1.of(RULES)
SAMPLED = SampledType1.of(RULES)
SETS = CentreOfSetsType2.of(RULES, FOOTPRINT, FOOTPRINT)
CENTROID = CentroidType2.of(RULES, FOOTPRINT, FOOTPRINT)
REFERENCES = {
    "exact_t1_41x41": (1e-10, lambda e, de: exact_type1(EXACT, e, de)),
    "matlab_rule_sum101_t1_41x41": (1e-12, lambda e, de: sampled_type1(SAMPLED, e, de)),
    "it2_cos_exact_paper_41x41": (1e-10, lambda e, de: ends(centre_of_sets_type2(SETS, e, de))),
    "it2_cos101_paper_41x41": (
        1e-10,
        lambda e, de: ends(
            centre_of_sets_type2(SETS._replace(centroids=sampled_centroids(FOOTPRINT)), e, de)
        ),
    ),
    "it2_centroid101_paper_41x41": (1e-10, lambda e, de: ends(centroid_type2(CENTROID, e, de))),
}


@pytest.mark.parametrize("name", REFERENCES)
def test_agrees_with_reference(name):
    tolerance, infer = REFERENCES[name]
    rows = shared_table(f"reference/fuzzy/{name}.csv")
    ours = np.array([infer(e, de) for e, de in rows[:, :2].tolist()])
    np.testing.assert_allclose(ours, rows[:, 2:], rtol=0.0, atol=tolerance)


def test_published_rules_and_sets_are_those_of_the_file():
    text = shared("paper/IT1FUZZY.fis").read_text()
    cells = re.findall(r"^(\d) (\d), (\d) (\d) (\d) \(1\) : 1", text, re.MULTILINE)
    assert len(cells) == 49
    for cell in cells:
        i, j, *gains = (int(number) - 1 for number in cell)
        assert published_rules()[i, j].tolist() == gains
    found = [[float(x) for x in mf.split()] for mf in re.findall(r"'trimf',\[(.*?)\]", text)]
    assert found == [*INPUT_SETS.tolist() * 2, *OUTPUT_SETS.tolist() * 3]


def test_the_two_rule_tables_differ_in_two_cells():
    rows, columns = np.nonzero((paper_rules() != published_rules()).any(axis=2))
    assert [(LABELS[i], LABELS[j]) for i, j in zip(rows, columns, strict=True)] == [
        ("NS", "NM"),
        ("PS", "NM"),
    ]


@relaxed
@given(heights)
def test_exact_centroid_is_the_limit_of_finer_samples(cut):
    at = np.linspace(-0.1, 0.1, 20001)
    a, b, c = OUTPUT_SETS.T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.where(a == b, np.inf, (at - a) / (b - a))
        fall = np.where(b == c, np.inf, (c - at) / (c - b))
    sets = np.clip(np.minimum(rise, fall), 0.0, 1.0)
    union = np.minimum(np.array(cut)[:, None], sets).max(axis=0)
    expected = np.trapezoid(union * at, at) / np.trapezoid(union, at)
    assert exact_centroid(np.array(cut), OUTPUT_SETS) == pytest.approx(expected, abs=2e-6)


@relaxed
@given(heights)
def test_exact_centroid_is_odd(cut):
    up, down = np.array(cut), np.array(cut[::-1])
    assert exact_centroid(up, OUTPUT_SETS) == pytest.approx(
        -exact_centroid(down, OUTPUT_SETS), abs=1e-14
    )


@relaxed
@given(
    st.lists(
        st.tuples(st.floats(-1.0, 1.0), st.just(0.0) | st.floats(1e-9, 1.0), st.floats(1e-3, 1.0)),
        min_size=1,
        max_size=12,
    ),
    st.booleans(),
)
def test_karnik_mendel_finds_the_extremes_over_all_switch_points(points, surely_fired):
    at, low, high = np.array(sorted(points)).T
    low = np.minimum(low, high) * surely_fired
    means = []
    for k in range(len(at) + 1):
        for weights in (np.r_[high[:k], low[k:]], np.r_[low[:k], high[k:]]):
            if weights.sum() > 0.0:
                means.append((weights * at).sum() / weights.sum())
    least, greatest = karnik_mendel(at, low, high)
    assert least == pytest.approx(min(means), abs=1e-12)
    assert greatest == pytest.approx(max(means), abs=1e-12)


@relaxed
@given(st.just(0.0) | st.floats(1e-3, 1.0), st.floats(0.0, 0.9))
def test_exact_set_centroids_are_the_limit_of_finer_samples(scale, lag):
    footprint = Footprint(scale, lag)
    at = np.linspace(-0.1, 0.1, 2001)
    lower = sampled(lagged(OUTPUT_SETS, footprint), at, scale)
    upper = sampled(OUTPUT_SETS, at, 1.0)
    fine = [karnik_mendel(at, *pair) for pair in zip(lower, upper, strict=True)]
    exact = set_centroids(OUTPUT_SETS, footprint)
    np.testing.assert_allclose(exact, fine, rtol=0.0, atol=1.5e-4)
    assert (np.diff(exact, axis=0) >= 0.0).all()  # as the reduction by centre of sets needs


@relaxed
@given(inputs, inputs)
def test_without_footprint_type2_is_type1(error, change):
    system = CentroidType2.of(RULES, CRISP, CRISP)
    least, greatest = centroid_type2(system, error, change)
    expected = sampled_type1(SAMPLED, error, change)
    assert least == pytest.approx(expected, abs=1e-15)
    assert greatest == pytest.approx(expected, abs=1e-15)
    least, greatest = centre_of_sets_type2(CentreOfSetsType2.of(RULES, CRISP, CRISP), error, change)
    assert least == pytest.approx(greatest, abs=1e-15)


@relaxed
@given(inputs, inputs)
def test_the_reduced_interval_is_one_and_holds_type1(error, change):
    least, greatest = centroid_type2(CENTROID, error, change)
    within = sampled_type1(SAMPLED, error, change)
    for low, middle, high in zip(least, within, greatest, strict=True):
        assert -0.1 <= low <= middle + 1e-15
        assert middle <= high + 1e-15
        assert high <= 0.1


@pytest.mark.parametrize("preset", ["paper", "published-code"])
@pytest.mark.parametrize("kind", ["t1", "t2"])
class TestTuners:
    def test_changes_stay_in_range(self, kind, preset):
        tune = fuzzy_tuner(kind, preset)
        grid = np.linspace(-1.0, 1.0, 21).tolist()
        changes = np.array([tune(e, de) for e in grid for de in grid])
        assert np.abs(changes).max() < 0.1
        assert len(np.unique(changes.round(9), axis=0)) > 300  # it does tune

    @pytest.mark.parametrize("outside", [(1.01, 0.0), (0.0, -1.01), (5.0, 5.0)])
    def test_no_rule_fires_outside(self, kind, preset, outside):
        assert fuzzy_tuner(kind, preset)(*outside) == (0.0, 0.0, 0.0)

    def test_is_near_its_peers(self, kind, preset):
        """The documented distance of the four systems: two hundredths of an output span of 0.2."""
        one, other = fuzzy_tuner(kind, preset), fuzzy_tuner("t1", "paper")
        grid = np.linspace(-1.0, 1.0, 11).tolist()
        gap = [np.subtract(one(e, de), other(e, de)) for e in grid for de in grid]
        assert np.abs(gap).max() < 0.06
