"""Interval type 3: degenerate cases, and convergence in the number of z-slices."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from omnidrive.fuzzy.files import load
from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.variables import Footprint, FuzzySet, Secondary
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import systems
from tests.shared_data import shared

SEEDS = st.integers(0, 2**32 - 1)
CONTINUOUS = {
    "sugeno": (False,),
    "defuzzifiers": ("centroid",),
    "conjunctions": oracle.CONTINUOUS_NORMS,
    "disjunctions": oracle.CONTINUOUS_CONORMS,
    "aggregations": oracle.CONTINUOUS_CONORMS,
}


def with_secondary(system, secondary):
    def each(s):
        return replace(s, secondary=secondary) if isinstance(s, FuzzySet) else s

    def one(variable):
        return replace(variable, sets=tuple(map(each, variable.sets)))

    return replace(
        system, inputs=tuple(map(one, system.inputs)), outputs=tuple(map(one, system.outputs))
    )


@given(
    systems(types=(2,), sugeno=(False, True), defuzzifiers=("centroid", "wtaver", "wtsum")),
    SEEDS,
    st.integers(1, 7),
    st.sampled_from(["centroid", "cos"]),
)
@examples(40)
def test_infinite_spread_gives_type_2(system, seed, slices, reduction):
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    options = {"reduction": reduction, "samples": 51}
    wide = with_secondary(system, Secondary(np.inf))
    assert wide.type == 3
    found = Inference(wide, slices=slices, **options).batch(at)
    expected = Inference(system, **options).batch(at)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14)


@given(systems(types=(1,), **CONTINUOUS), SEEDS)
@examples(40)
def test_without_footprint_type_3_equals_type_1(system, seed):
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    run = Inference(system, samples=51)
    at = at[[max((f.upper for f in run.fired_rules(*x)), default=0) > 1e-6 for x in at]]
    thin = system.with_footprint(Footprint(), secondary=Secondary(0.7, 0.8, 0.1))
    scale = oracle.spans(system)
    found = Inference(thin, slices=3, samples=51).batch(at)
    np.testing.assert_allclose(found / scale, run.batch(at) / scale, atol=1e-8)


@given(systems(types=(3,), max_outputs=1, max_inputs=2, **CONTINUOUS), SEEDS, st.integers(1, 3))
@examples(40)
def test_type_3_is_mean_of_z_slices_weighted_by_levels(system, seed, slices):
    algorithm = "km" if system.algorithm == "nie-tan" else system.algorithm
    run = Inference(system, centroid="matlab", samples=21, slices=slices, algorithm=algorithm)
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    output = system.outputs[0]
    at = oracle.even(output, 21)
    for k in range(slices):
        for of_lower in (False, True):
            z_slice = ((k + 0.5) / slices, of_lower)
            for degrees in oracle.aggregate(system, output, x, at, z_slice):
                assume(((degrees == 0) | (degrees > 1e-9)).all())
    found = run.batch(x[None])[:, 0]
    scale = oracle.spans(system)
    expected = oracle.type3(system, x, slices, 21)
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)


def paper(secondary):
    system = load(shared("paper/IT1FUZZY.fis"))
    return system.with_footprint(Footprint(1.0, 0.3), secondary=secondary)


@pytest.mark.parametrize("most", [96, pytest.param(256, marks=pytest.mark.long)])
@pytest.mark.parametrize("secondary", [Secondary(), Secondary(0.6), Secondary(1.0, 0.8, 0.2)])
def test_type_3_converges_in_number_of_slices(secondary, most):
    """The width of a z-slice is a square root near its top, also of the lower function's top.

    This reduces the order of the midpoint rule by one half at the end, and a little more within.
    """
    system = paper(secondary)
    at = oracle.points_in(system, np.random.default_rng(0), 50)
    counts = np.array([4, 8, 16, 32])
    options = {"centroid": "matlab"}
    runs = [Inference(system, slices=int(n), **options).batch(at) for n in counts]
    limit = Inference(system, slices=most, **options).batch(at)
    errors = np.array([np.abs(run - limit).mean() for run in runs])
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > 1.0
    assert errors[-1] < 1e-4
    assert errors[-1] < errors[0] / 4


@pytest.mark.long
def test_type_3_interval_widens_with_spread():
    """The limits are the midpoints of the footprints and the full footprints."""
    at = oracle.points_in(paper(None), np.random.default_rng(0), 100)
    runs = [Inference(paper(Secondary(s))).batch(at) for s in (1e-6, 0.3, 1.0, 3.0, np.inf)]
    widths = np.array([run[2] - run[1] for run in runs])
    assert (widths[0] < 1e-5).all()
    assert (np.diff(widths, axis=0) > -1e-12).all()
    np.testing.assert_allclose(runs[-1], Inference(paper(None)).batch(at), atol=1e-13)
