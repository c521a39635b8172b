"""Membership functions against Matlab's documented formulas, and footprints of triangles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.membership import SHAPES, Membership
from omnidrive.fuzzy.norms import (
    AGGREGATIONS,
    CONORMS,
    HEDGE_CODES,
    NORMS,
    apply_hedge,
    t_conorm,
    t_norm,
)
from omnidrive.fuzzy.sets import membership_bounds
from omnidrive.fuzzy.variables import Footprint, FuzzySet, Secondary
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import fuzzy_sets, memberships

UNIT = st.floats(0.0, 1.0)
EVERY = UNIT | st.floats(0.0, 1e-12) | st.floats(0.0, 1e-12).map(lambda v: 1.0 - v)
AT = np.r_[np.linspace(-2.0, 2.0, 81), -1e9, 1e9, np.nextafter(0.0, 1.0)]


def test_every_shape_has_formula():
    assert set(oracle.FORMULAS) == set(SHAPES)
    assert len(SHAPES) == 15


@pytest.mark.parametrize("shape", SHAPES)
@given(data=st.data())
@examples(40)
def test_degrees_match_formula(shape, data):
    function = data.draw(memberships(shapes=(shape,)))
    corners = [p for p in function.parameters if abs(p) <= 10]
    at = np.r_[AT, corners]
    with np.errstate(over="ignore"):
        expected = oracle.curve(function, at)
    found = function(at)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=2e-15)
    assert (found >= 0).all()
    assert (found <= 1).all()
    assert function(float(at[3])) == found[3]


@pytest.mark.parametrize(
    ("shape", "parameters", "x", "degree"),
    [  # from Matlab's documentation and computed by hand
        ("trimf", (3, 6, 8), 4, 1 / 3),
        ("trimf", (0, 0, 2), 0, 1.0),
        ("trimf", (0, 0, 2), -1e-300, 0.0),
        ("trimf", (0, 2, 2), 2, 1.0),
        ("trapmf", (1, 5, 7, 8), 7.25, 0.75),
        ("linzmf", (4, 6), 5.5, 0.25),
        ("linsmf", (4, 6), 5.5, 0.75),
        ("linsmf", (4, 4), 4, 1.0),
        ("zmf", (3, 7), 4, 0.875),
        ("zmf", (3, 7), 6, 0.125),
        ("smf", (1, 8), 4.5, 0.5),
        ("smf", (1, 1), 1, 1.0),
        ("pimf", (1, 4, 5, 10), 2.5, 0.5),
        ("pimf", (1, 4, 5, 10), 7.5, 0.5),
        ("gaussmf", (2, 5), 7, np.exp(-0.5)),
        ("gauss2mf", (1, 4, 2, 6), 5, 1.0),
        ("gauss2mf", (1, 4, 2, 6), 8, np.exp(-0.5)),
        ("gauss2mf", (1, 6, 2, 4), 5, np.exp(-0.5) * np.exp(-0.125)),
        ("gbellmf", (2, 4, 6), 8, 0.5),
        ("gbellmf", (2, 1, 6), 10, 0.2),
        ("sigmf", (2, 4), 4, 0.5),
        ("sigmf", (2, 4), 5, 1 / (1 + np.exp(-2))),
        ("dsigmf", (5, 2, 5, 7), 2, 0.5 - 1 / (1 + np.exp(25))),
        ("dsigmf", (5, 7, 5, 2), 2, 0.5 - 1 / (1 + np.exp(25))),
        ("psigmf", (2, 3, -5, 8), 3, 0.5 / (1 + np.exp(-25))),
        ("pointsmf", (0, 0, 1, 0.5, 1, 1, 3, 0), 1, 1.0),
        ("pointsmf", (0, 0, 1, 0.5, 1, 1, 3, 0), 0.5, 0.25),
        ("pointsmf", (0, 0, 1, 0.5, 1, 1, 3, 0), 2.0, 0.5),
        ("pointsmf", (0, 0.3, 1, 0.5), -9, 0.3),
    ],
)
def test_known_degrees(shape, parameters, x, degree):
    assert Membership(shape, parameters)(float(x)) == pytest.approx(degree, abs=1e-15)


@given(
    st.tuples(st.floats(-2, 2), st.floats(0.01, 2), st.floats(0.01, 2)),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.9),
    st.floats(0.0, 0.9),
)
@examples(60)
def test_footprint_of_triangle_is_lower_narrower_triangle(sides, scale, left, right):
    middle, before, after = sides
    a, b, c = middle - before, middle, middle + after
    each = FuzzySet("t", Membership("trimf", (a, b, c)), Footprint(scale, left, right))
    lower, upper = (row[0] for row in membership_bounds([each], AT))
    start, stop = a + left * (b - a), c - right * (c - b)
    expected = scale * np.interp(AT, [start, b, stop], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(lower, expected, atol=1e-12)
    np.testing.assert_allclose(upper, np.interp(AT, [a, b, c], [0.0, 1.0, 0.0]), atol=1e-12)


@given(
    fuzzy_sets("s", -1.0, 1.0, tuple(SHAPES), 3, free_lower=True),
    st.floats(0.01, 0.99),
    st.booleans(),
)
@examples(200)
def test_bounds_and_z_slices_match_definition(each, level, of_lower):
    from omnidrive.fuzzy.sets import ZSlice

    with np.errstate(over="ignore"):
        for z_slice, own in ((None, ZSlice(0.0, of_lower=False)), ((level, of_lower), None)):
            expected = oracle.bounds(each, AT, z_slice)
            found = membership_bounds([each], AT, own or ZSlice(level, of_lower))
            for mine, theirs in zip(found, expected, strict=True):
                np.testing.assert_allclose(mine[0], theirs, atol=1e-11)
            assert (found[0] <= found[1] + 1e-15).all()


@pytest.mark.parametrize("norm", NORMS)
@given(UNIT, UNIT)
@examples(60)
def test_t_norms_match_textbook(norm, a, b):
    assert t_norm(NORMS[norm], a, b) == pytest.approx(oracle.NORMS[norm](a, b), abs=1e-15)
    assert t_norm(NORMS[norm], a, b) == t_norm(NORMS[norm], b, a)
    assert t_norm(NORMS[norm], a, 1.0) == a


@pytest.mark.parametrize("norm", AGGREGATIONS)
@given(EVERY, EVERY)
@example(1.0, np.nextafter(1.0, 0.0))  # (a + b - 2 a b)/(1 - a b) is 2 here
@examples(60)
def test_t_conorms_match_textbook_for_small_degrees(norm, a, b):
    """A centroid divides by the sum of the degrees: small ones must keep their precision."""
    found = t_conorm(AGGREGATIONS[norm], a, b)
    assert found <= 1.0 + 1e-15 or norm == "sum"
    assert found == pytest.approx(oracle.CONORMS[norm](a, b), rel=1e-12, abs=1e-300)
    assert t_conorm(AGGREGATIONS[norm], 0.0, b) == pytest.approx(b, rel=1e-12, abs=1e-300)
    assert t_conorm(AGGREGATIONS[norm], a, 1.0) == (a + 1.0 if norm == "sum" else 1.0)


@pytest.mark.parametrize("hedge", [h for h in HEDGE_CODES if h != "not"])
@given(UNIT, UNIT)
@examples(40)
def test_hedges_are_monotone_and_match_fuzzylite(hedge, a, b):
    found = [apply_hedge(HEDGE_CODES[hedge], v) for v in sorted((a, b))]
    assert found[0] <= found[1]
    assert found[1] == pytest.approx(oracle.HEDGES[hedge](max(a, b)), abs=1e-15)


def test_secondary_of_zero_width_gives_midpoint():
    each = FuzzySet("s", Membership("trimf", (-1, 0, 1)), Footprint(0.5, 0.2), Secondary(1e-9))
    from omnidrive.fuzzy.sets import ZSlice

    lower, upper = membership_bounds([each], AT, ZSlice(0.5, of_lower=False))
    whole = membership_bounds([replace(each, secondary=None)], AT)
    np.testing.assert_allclose(upper - lower, 0.0, atol=1e-8)
    np.testing.assert_allclose(upper, (whole[0] + whole[1]) / 2, atol=1e-8)


@pytest.mark.parametrize(
    ("shape", "parameters", "says"),
    [
        ("triangle", (0, 1, 2), "there is no membership function"),
        ("trimf", (0, 1), "needs 3 parameters"),
        ("trimf", (0, 2, 1), "needs a <= b <= c"),
        ("gbellmf", (0, 1, 1), "a must not be 0"),
        ("cosinemf", (-1, 0), "a must not be negative"),
        ("sigmf", (float("nan"), 1), "nan is not a finite number of at most 1e.100 in"),
        ("sigmf", (1, 1.1e100), "1.1e.100 is not a finite number of at most 1e.100"),
        ("pointsmf", (), "pairs of x and degree"),
        ("pointsmf", (0, 0, 1), "pairs of x and degree"),
        ("pointsmf", (1, 0, 0, 1), "must ascend"),
        ("pointsmf", (0, 0, 1, 1.5), "must lie in"),
    ],
)
def test_invalid_membership_function_is_refused(shape, parameters, says):
    with pytest.raises(InvalidInput, match=says):
        Membership(shape, parameters)


def test_every_aggregation_has_formula():
    assert set(oracle.CONORMS) == set(AGGREGATIONS)
    assert set(CONORMS) | {"sum"} == set(AGGREGATIONS)
