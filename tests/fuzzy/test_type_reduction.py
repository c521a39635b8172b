"""Interval type 2: reference values, agreement of algorithms, properties of type reduction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from omnidrive.choices import ALGORITHMS
from omnidrive.fuzzy.files import load
from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.reduction import type_reduce
from omnidrive.fuzzy.segment_centroid import centroid_interval
from omnidrive.fuzzy.variables import Footprint
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import systems
from tests.shared_data import shared, shared_table

SEEDS = st.integers(0, 2**32 - 1)
PLAIN_ALGORITHMS = [a for a in ALGORITHMS if a != "nie-tan"]
STRAIGHT = ("trimf", "trapmf", "linzmf", "linsmf", "pointsmf")
CONTINUOUS = {
    "sugeno": (False,),
    "defuzzifiers": ("centroid",),
    "conjunctions": oracle.CONTINUOUS_NORMS,
    "disjunctions": oracle.CONTINUOUS_CONORMS,
    "aggregations": oracle.CONTINUOUS_CONORMS,
}


def close(found, expected, system, digits):
    scale = oracle.spans(system)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=digits)


def is_well_posed(system, x):
    """Whether every output has clearly firing rules, or clearly none."""
    tops = [
        max((high for *_, high in oracle.consequents(system, o, x)), default=0.0)
        for o in system.outputs
    ]
    return all(top == 0.0 or top > 1e-6 for top in tops)


def is_well_conditioned(system, x, samples):
    """Whether no weight is so small relative to others that rounding decides whether it counts.

    Without lower weights, any point of the support may be the mean, however small its weight.
    """
    weights = []
    for output in system.outputs:
        at = oracle.even(output, samples)
        weights += oracle.aggregate(system, output, x, at)
        for each, negated, *strengths in oracle.consequents(system, output, x):
            degrees = oracle.bounds(each, at)
            weights += [np.array(strengths), *((1 - d for d in degrees) if negated else degrees)]
    weights = np.concatenate(weights)
    return bool(((weights == 0) | (weights > 1e-9)).all())


@pytest.mark.parametrize("algorithm", PLAIN_ALGORITHMS)
@pytest.mark.parametrize(
    ("table", "reduction", "centroid"),
    [
        ("centroid101", "centroid", "matlab"),
        ("centroid_exact", "centroid", "exact"),
        ("cos101", "cos", "matlab"),
        ("cos_exact", "cos", "exact"),
    ],
)
def test_published_system_matches_reference_values(table, reduction, centroid, algorithm):
    expected = shared_table(f"reference/fuzzy/it2_{table}_paper_41x41.csv")
    system = load(shared("paper/IT1FUZZY.fis")).with_footprint(Footprint(1.0, 0.3))
    run = Inference(system, reduction=reduction, centroid=centroid, algorithm=algorithm)
    value, least, greatest = run.batch(expected[:, :2])
    assert np.abs(value - expected[:, 2:5]).max() < 1e-10
    assert np.abs(least - expected[:, 5::2]).max() < 1e-10
    assert np.abs(greatest - expected[:, 6::2]).max() < 1e-10


WEIGHTS = st.lists(
    st.tuples(
        st.floats(-10.0, 10.0),
        st.floats(0.0, 1.0) | st.just(0.0),
        st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0]),
    ),
    min_size=1,
    max_size=12,
)


@given(WEIGHTS)
@examples(200)
def test_every_algorithm_finds_optimal_switch_point(points):
    """Single points, equal points, weights of zero, no lower weights at all."""
    at, part, upper = np.array(sorted(points)).T.copy()
    upper = np.where(upper < 1e-6, 0.0, upper)
    lower = upper * np.where(part < 1e-6, 0.0, part)
    assume(upper.max() > 0)
    expected = oracle.weighted_interval((at, at), lower, upper)
    for k, algorithm in enumerate(ALGORITHMS):
        found = type_reduce(k, at, lower, upper)
        if algorithm == "nie-tan":
            middle = (lower + upper) @ at / (lower + upper).sum()
            assert found == pytest.approx((middle, middle), abs=1e-9)
            assert expected[0] - 1e-9 <= middle <= expected[1] + 1e-9
        else:
            assert found == pytest.approx(expected, abs=1e-9), algorithm


@given(systems(types=(2,), **CONTINUOUS), SEEDS)
@examples(80)
def test_sampled_interval_matches_textbook_formulas(system, seed):
    run = Inference(system, centroid="matlab", samples=31)
    if system.algorithm == "nie-tan":
        run = Inference(system, centroid="matlab", samples=31, algorithm="km")
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    assume(is_well_posed(system, x))
    found = run.batch(x[None])[:, 0]
    for output in system.outputs:
        at = oracle.even(output, 31)
        low, high = oracle.aggregate(system, output, x, at)
        assume(high.max() == 0 or high.max() > 1e-6)
        assume(((low == 0) | (low > 1e-9)).all())  # the end of the weights decides the interval
        assume(((high == 0) | (high > 1e-9)).all())
    close(found, oracle.centroid(system, x, 31), system, 1e-6)


@given(systems(types=(1, 2), **CONTINUOUS), SEEDS)
@examples(80)
def test_centre_of_sets_matches_textbook_formulas(system, seed):
    algorithm = "km" if system.algorithm == "nie-tan" else None
    run = Inference(system, centroid="matlab", samples=31, reduction="cos", algorithm=algorithm)
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    for output in system.outputs:
        found = list(oracle.consequents(system, output, x))
        assume(all(u == 0 or u > 1e-6 for *_, u in found))
        assume(all(v == 0 or v > 1e-9 for *_, v, _ in found))
        at = oracle.even(output, 31)
        for each, negated, *_ in found:
            low, high = oracle.bounds(each, at)
            low, high = (1 - high, 1 - low) if negated else (low, high)
            assume(((low == 0) | (low > 1e-9)).all() and ((high == 0) | (high > 1e-9)).all())
    close(run.batch(x[None])[:, 0], oracle.centre_of_sets(system, x, 31), system, 1e-6)


STEADY = CONTINUOUS | {"hedges": (), "negated_consequents": False}


@given(systems(types=(2, 3), **STEADY), SEEDS, st.sampled_from(["centroid", "cos"]))
@examples(40)
def test_interval_contains_type_1_and_nie_tan_values(system, seed, reduction):
    """The upper functions are one of the type-1 systems embedded in a type-2 system."""
    options = {"reduction": reduction, "samples": 51, "slices": 2}
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    run = Inference(system, algorithm="km", **options)
    at = at[[max((f.upper for f in run.fired_rules(*x)), default=0) > 1e-6 for x in at]]
    value, least, greatest = run.batch(at)
    slack = 1e-9 * oracle.spans(system)
    assert (least <= value + slack).all()
    assert (value <= greatest + slack).all()
    np.testing.assert_allclose(value, (least + greatest) / 2, atol=1e-9 * slack.max() + 1e-12)
    middle, a, b = Inference(system, algorithm="nie-tan", **options).batch(at)
    assert (least <= a + slack).all()
    assert (b <= greatest + slack).all()
    if reduction == "centroid":
        np.testing.assert_array_equal(a, b)
        np.testing.assert_allclose(middle, a, atol=1e-12)
    if system.type == 2:
        plain = Inference(oracle.without_footprint(system), **options).batch(at)[0]
        assert (least <= plain + slack).all()
        assert (plain <= greatest + slack).all()


@given(systems(types=(2,), **CONTINUOUS), SEEDS, st.sampled_from(["centroid", "cos"]))
@examples(40)
def test_all_algorithms_agree_on_random_systems(system, seed, reduction):
    at = oracle.points_in(system, np.random.default_rng(seed), 20)
    at = at[[is_well_conditioned(system, x, 51) for x in at]]
    found = [
        Inference(system, algorithm=a, reduction=reduction, samples=51).batch(at)
        for a in PLAIN_ALGORITHMS
    ]
    for other in found[1:]:
        close(other, found[0], system, 1e-7)


@given(systems(types=(1,), **CONTINUOUS), SEEDS, st.sampled_from(ALGORITHMS))
@examples(30)
def test_without_footprint_type_2_equals_type_1(system, seed, algorithm):
    at = oracle.points_in(system, np.random.default_rng(seed), 20)
    run = Inference(system)
    at = at[[max((f.upper for f in run.fired_rules(*x)), default=0) > 1e-6 for x in at]]
    uncertain = system.with_footprint(Footprint())
    for reduction in ("centroid", "cos"):
        plain = Inference(system, reduction=reduction).batch(at)
        degenerate = Inference(uncertain, algorithm=algorithm, reduction=reduction)
        assert degenerate.system.type == 2
        close(degenerate.batch(at), plain, system, 1e-8)


@given(
    systems(types=(2,), **CONTINUOUS | {"output_shapes": STRAIGHT, "aggregations": ("max",)}), SEEDS
)
@examples(40)
def test_exact_interval_bounds_sampled_centroids(system, seed):
    """With fine midpoint samples and all switch points, the exact ends are met, not exceeded."""
    run = Inference(system, centroid="exact", algorithm="km")
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    assume(is_well_posed(system, x))
    _, least, greatest = run.batch(x[None])[:, 0]
    for o, output in enumerate(system.outputs):
        width = output.high - output.low
        at = output.low + width * (np.arange(4000) + 0.5) / 4000
        lower, upper = oracle.aggregate(system, output, x, at)
        if upper.max() == 0:
            continue
        assume(lower.sum() > 40)  # an area of 1/100 of the range, so that samples are fine enough
        up, low = np.cumsum([upper, upper * at], axis=1), np.cumsum([lower, lower * at], axis=1)
        left = up + low[:, -1:] - low
        right = low + up[:, -1:] - up
        assert least[o] == pytest.approx((left[1] / left[0]).min(), abs=5e-3 * width)
        assert greatest[o] == pytest.approx((right[1] / right[0]).max(), abs=5e-3 * width)


def test_wider_footprint_gives_wider_interval():
    system = load(shared("paper/IT1FUZZY.fis"))
    at = oracle.points_in(system, np.random.default_rng(1), 200)
    before = None
    for lag in (0.0, 0.1, 0.3, 0.6):
        _, least, greatest = Inference(system.with_footprint(Footprint(1 - lag / 2, lag))).batch(at)
        if before is not None:
            assert (least <= before[0] + 1e-12).all()
            assert (greatest >= before[1] - 1e-12).all()
        before = least, greatest


@pytest.mark.parametrize("tiny", [1e-6, 1e-12, 1e-30, 1e-70, 1e-150])
def test_tiny_lower_membership_approaches_none(tiny):
    """The ends must not be computed as the difference of two nearly equal areas."""
    upper = np.array([[-1.0, 0.0], [0.0, 1.0], [0.0, 0.4], [0.4, 0.7]])
    lower = np.array([[0.0], [1.0], [tiny], [tiny]])
    least, greatest = centroid_interval(0, lower, upper)
    tolerance = 1e-12 + 3 * tiny ** (1 / 3)  # the rest of the upper function has as small an area
    assert -1.0 <= least <= -1.0 + tolerance
    assert 1.0 - tolerance <= greatest <= 1.0


def test_interval_without_lower_membership_is_support():
    """With scale 0, any point of the upper function may be the centroid."""
    system = load(shared("paper/IT1FUZZY.fis")).with_footprint(Footprint(0.0))
    value, least, greatest = Inference(system).batch(np.array([[0.0, 0.0], [0.9, 0.9]]))
    plain = Inference(replace(oracle.without_footprint(system)))
    assert plain.system.type == 1
    assert (least < value).all()
    assert (value < greatest).all()
    for algorithm in PLAIN_ALGORITHMS:
        other = Inference(system, algorithm=algorithm).batch(np.array([[0.0, 0.0], [0.9, 0.9]]))
        np.testing.assert_allclose(other, [value, least, greatest], atol=1e-12)
