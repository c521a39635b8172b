"""Inference of type-1 and Sugeno systems, and properties of all types, against a slow evaluator."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from omnidrive.fuzzy.files import load
from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rule_text import parse_rule
from omnidrive.fuzzy.rules import HEDGES, And, Is, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, InputVariable, LinearFunction, OutputVariable
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import systems
from tests.shared_data import shared, shared_table

SEEDS = st.integers(0, 2**32 - 1)
STRAIGHT = ("trimf", "trapmf", "linzmf", "linsmf", "pointsmf")
CONTINUOUS = {
    "conjunctions": oracle.CONTINUOUS_NORMS,
    "disjunctions": oracle.CONTINUOUS_CONORMS,
    "aggregations": (*oracle.CONTINUOUS_CONORMS, "sum"),
}
"""Operators that do not jump, so that two roundings of one number cannot part ways."""


def paper():
    return load(shared("paper/IT1FUZZY.fis"))


def close(found, expected, system, digits=1e-9):
    """Whether all outputs agree, relative to their ranges."""
    scale = oracle.spans(system)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=digits)


# --- reference data --------------------


@pytest.mark.parametrize(
    ("table", "centroid", "tolerance"),
    [("matlab_rule_sum101_t1", "matlab", 1e-12), ("exact_t1", "exact", 1e-10)],
)
def test_published_system_matches_reference_values(table, centroid, tolerance):
    expected = shared_table(f"reference/fuzzy/{table}_41x41.csv")
    found = Inference(paper(), centroid=centroid)(expected[:, :2])
    assert np.abs(found - expected[:, 2:]).max() < tolerance


def test_octave_matches_within_trapezoid_rule_error():
    """Columns kp_s to kd_s hold the centroid by the sum rule, which Octave's toolkit also has."""
    expected = shared_table("reference/fuzzy/octave_t1_41x41_101.csv")
    found = Inference(paper(), centroid="matlab")(expected[:, :2])
    assert np.abs(found - expected[:, 5:]).max() < 1e-12
    trapezoid = Inference(paper())(expected[:, :2]) - expected[:, 2:5]
    assert np.abs(trapezoid).max() < 2e-4  # error of the rule on 101 samples; ranges are 0.2


def test_exact_centroid_is_default_for_polylines():
    assert Inference(paper()).options.centroid == "exact"
    smooth = replace(paper().outputs[0].sets[0], upper=Membership("gaussmf", (0.01, 0.0)))
    output = replace(paper().outputs[0], sets=(smooth, *paper().outputs[0].sets[1:]))
    mixed = replace(paper(), outputs=(output, *paper().outputs[1:]))
    assert Inference(mixed).options.centroid == "matlab"


# --- the slow evaluator --------------------


@given(systems(types=(1,), sugeno=(False,), defuzzifiers=("centroid",), **CONTINUOUS), SEEDS)
@examples(80)
def test_sampled_mamdani_matches_textbook_formulas(system, seed):
    """All shapes, norms, hedges, nested antecedents, weights, complemented consequents."""
    run = Inference(system, centroid="matlab", samples=41)
    for x in oracle.points_in(system, np.random.default_rng(seed), 3):
        assume(is_well_posed(system, x))
        close(run(*x), oracle.centroid(system, x, 41)[0], system)


def is_well_posed(system, x):
    """Whether every output has clearly firing rules or clearly none, beyond rounding errors."""
    for output in system.outputs:
        at = oracle.even(output, 41)
        top = oracle.aggregate(system, output, x, at)[1].max()
        if 0.0 < top < 1e-6:
            return False
    return True


@given(systems(sugeno=(True,), types=(1, 2), algorithms=("km", "eiasc"), **CONTINUOUS), SEEDS)
@examples(80)
def test_sugeno_matches_textbook_formulas(system, seed):
    run = Inference(system)
    for x in oracle.points_in(system, np.random.default_rng(seed), 3):
        strengths = [max(u for *_, u in oracle.consequents(system, o, x)) for o in system.outputs
                     if list(oracle.consequents(system, o, x))]  # fmt: skip
        assume(all(s == 0 or s > 1e-6 for s in strengths))
        expected = oracle.sugeno(system, x)
        scale = 1e-10 * (1 + np.abs(expected).max() + 1e4)  # values up to 100 + 300 * 200
        np.testing.assert_allclose(run(*x), expected[0], rtol=0, atol=scale)
        np.testing.assert_allclose(run.interval(*x), expected[1:], rtol=0, atol=scale)


@given(
    systems(
        types=(1,),
        sugeno=(False,),
        defuzzifiers=("bisector", "mom", "som", "lom", "lm", "rm"),
        conjunctions=("min",),
        disjunctions=("max",),
        aggregations=("max",),
        implications=("min",),
        hedges=("not",),
    ),
    SEEDS,
)
@examples(60)
def test_sampled_defuzzifiers_match_matlab(system, seed):
    run = Inference(system, centroid="matlab", samples=41)
    for x in oracle.points_in(system, np.random.default_rng(seed), 3):
        found = run(*x)
        for value, output in zip(found, system.outputs, strict=True):
            at = oracle.even(output, 41)
            y = oracle.aggregate(system, output, x, at)[1]
            assume(y.max() == 0 or y.max() > 1e-6)
            if y.max() > 0:
                assert any(abs(value - v) <= 1e-12 * 300 for v in matlab(output.defuzzifier, at, y))


@pytest.mark.parametrize(
    ("defuzzifier", "expected"),
    [("mom", 6.0), ("som", 3.0), ("lom", 9.0), ("lm", 3.0), ("rm", 9.0)],
)
def test_equal_peaks_of_probabilistic_sums(defuzzifier, expected):
    """The peaks at 3 and 9 are 1 with 0.5 and 1 with 0.4, both of which give 1."""
    sets = (
        FuzzySet("near", Membership("trimf", (0, 3, 13))),
        FuzzySet("far", Membership("trimf", (-3, 9, 12))),
    )
    system = FuzzySystem(
        "peaks",
        (InputVariable("x", 0, 1, (FuzzySet("on", Membership("linsmf", (-1, 0))),)),),
        (OutputVariable("u", 0, 10, sets, "probor", defuzzifier),),
        tuple(parse_rule(f"if x is on then u is {each.name}") for each in sets),
    )
    assert Inference(system, centroid="matlab")(0.5)[0] == expected


def matlab(defuzzifier, at, y):
    """Return the possible values of Matlab's ``defuzz``; several if rounding decides."""
    tops = at[y >= y.max() * (1 - 1e-12)]
    if defuzzifier == "bisector":
        running = np.cumsum(y) / y.sum()
        near = np.flatnonzero(np.abs(running - 0.5) < 1e-9)
        last = len(at) - 1
        return at[[*near, *np.minimum(near + 1, last), np.argmax(running >= 0.5)]].tolist()
    strict = at[y == y.max()]
    ways = {
        "mom": np.mean,
        "som": lambda m: m[np.abs(m).argmin()],
        "lom": lambda m: m[np.abs(m).argmax()],
        "lm": lambda m: m[0],
        "rm": lambda m: m[-1],
    }
    both = [-ways[defuzzifier](m) for m in (tops, strict) if defuzzifier in {"som", "lom"}]
    return [ways[defuzzifier](m) for m in (tops, strict)] + both


# --- exact defuzzification --------------------

EXACT = {
    "types": (1,),
    "sugeno": (False,),
    "output_shapes": STRAIGHT,
    "aggregations": ("max",),
    "conjunctions": oracle.CONTINUOUS_NORMS,
    "disjunctions": oracle.CONTINUOUS_CONORMS,
}


@given(systems(**EXACT), SEEDS)
@examples(80)
def test_exact_defuzzifiers_match_polyline(system, seed):
    """The reference computes the aggregated output from the crossings of all pairs of lines."""
    run = Inference(system, centroid="exact")
    for x in oracle.points_in(system, np.random.default_rng(seed), 2):
        for value, output in zip(run(*x), system.outputs, strict=True):
            line = oracle.pieces(system, output, x)
            if line.size == 0 or line[:, 2:].max() <= 0:
                continue
            width = output.high - output.low
            area = areas(line)
            assume(area.sum() > 1e-4 * width)
            check_exact(output.defuzzifier, value, line, width)


def areas(line):
    x0, x1, y0, y1 = line.T
    return (x1 - x0) * (y0 + y1) / 2


def check_exact(defuzzifier, value, line, width):
    x0, x1, y0, y1 = line.T
    area = areas(line)
    if defuzzifier == "centroid":
        middle = (x0 + x1) / 2  # Simpson's rule, exact for quadratics
        moment = (x1 - x0) / 6 * (x0 * y0 + 4 * middle * (y0 + y1) / 2 + x1 * y1)
        assert value == pytest.approx(moment.sum() / area.sum(), abs=1e-9 * width)
        return
    if defuzzifier == "bisector":
        cut = np.clip(value, x0, x1)
        at = y0 + (y1 - y0) * (cut - x0) / (x1 - x0)
        left = ((cut - x0) * (y0 + at) / 2).sum()
        assert left == pytest.approx(area.sum() / 2, abs=1e-9 * width)
        return
    top = max(y0.max(), y1.max())
    near = top - 1e-9
    ends = np.unique(np.r_[x0[y0 >= near], x1[y1 >= near]])
    flat = (y0 >= near) & (y1 >= near) & (x1 - x0 > 1e-9 * width)
    zero = [0.0] if ((x0 < 0) & (x1 > 0) & flat).any() else []
    points = np.r_[ends, zero]
    tolerance = 1e-6 * width  # 1e-9 of degree over the least slope
    if defuzzifier == "mom":
        length = (x1 - x0)[flat]
        if len(length):
            expected = (length * (x0 + x1)[flat] / 2).sum() / length.sum()
            assert value == pytest.approx(expected, abs=1e-4 * width)
        else:
            assert points.min() - tolerance <= value <= points.max() + tolerance
        return
    expected = {
        "lm": points.min(),
        "rm": points.max(),
        "som": np.abs(points).min(),
        "lom": np.abs(points).max(),
    }[defuzzifier]
    size = abs(value) if defuzzifier in {"som", "lom"} else value
    assert size == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize(
    ("shape", "ramp", "expected"),
    [("linsmf", (0.0, 1.25), 2 / 3), ("linzmf", (-0.25, 1.0), 1 / 3)],
)
@pytest.mark.parametrize("height", [1.0, 0.9])
def test_exact_centroid_of_ramp_with_top_beyond_range(shape, ramp, expected, height):
    """Clipping above the ramp's greatest degree within the range has no effect."""
    output = OutputVariable("y", 0, 1, (FuzzySet("s", Membership(shape, ramp)),))
    driver = InputVariable("x", 0, 1, (FuzzySet("s", Membership("linsmf", (0, 1))),))
    system = FuzzySystem("s", (driver,), (output,), (Rule(Is("x", "s"), (Is("y", "s"),)),))
    assert Inference(system)(height)[0] == pytest.approx(expected, abs=1e-12)


@given(
    systems(
        **EXACT | {"output_shapes": ("trimf", "trapmf")}, defuzzifiers=("centroid", "bisector")
    ),
    SEEDS,
)
@examples(25)
def test_exact_value_is_limit_of_fine_samples(system, seed):
    exact = Inference(system, centroid="exact")
    runs = [Inference(system, centroid="matlab", samples=n) for n in (1001, 32_001)]
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    for output in system.outputs:
        line = oracle.pieces(system, output, x)
        assume(line.size and areas(line).sum() > 1e-2 * (output.high - output.low))
    errors = [np.abs(run(*x) - exact(*x)) / oracle.spans(system) for run in runs]
    for error, count in zip(errors, (1001, 32_001), strict=True):
        assert error.max() < 300 / count  # a jump of 1 shifts 1/count of area over 1e-2 of it


def test_sampled_centroid_converges_quadratically():
    """If the aggregated output is zero at both ends, the sum rule equals the trapezoid rule."""
    sets = (
        FuzzySet("a", Membership("trimf", (0.1, 0.3, 0.6))),
        FuzzySet("b", Membership("trapmf", (0.35, 0.6, 0.7, 0.93))),
    )
    inputs = (
        InputVariable(
            "x",
            0,
            1,
            (
                FuzzySet("l", Membership("linzmf", (0, 1))),
                FuzzySet("r", Membership("linsmf", (0, 1))),
            ),
        ),
    )
    rules = tuple(Rule(Is("x", s), (Is("y", t),)) for s, t in (("l", "a"), ("r", "b")))
    system = FuzzySystem("s", inputs, (OutputVariable("y", 0, 1, sets),), rules)
    at = np.linspace(0.05, 0.95, 40)[:, None]
    exact = Inference(system)(at)
    errors = [
        np.abs(Inference(system, centroid="matlab", samples=n)(at) - exact).mean()
        for n in (101, 1001, 10_001)
    ]
    assert all(a / b > 50 for a, b in pairwise(errors))  # 100 for order two


# --- symmetries --------------------

MIRRORED = {
    "cosinemf": lambda a, c: ("cosinemf", (a, -c)),
    "trimf": lambda a, b, c: ("trimf", (-c, -b, -a)),
    "trapmf": lambda a, b, c, d: ("trapmf", (-d, -c, -b, -a)),
    "pimf": lambda a, b, c, d: ("pimf", (-d, -c, -b, -a)),
    "linzmf": lambda a, b: ("linsmf", (-b, -a)),
    "linsmf": lambda a, b: ("linzmf", (-b, -a)),
    "zmf": lambda a, b: ("smf", (-b, -a)),
    "smf": lambda a, b: ("zmf", (-b, -a)),
    "gaussmf": lambda s, c: ("gaussmf", (s, -c)),
    "gauss2mf": lambda s, c, t, d: ("gauss2mf", (t, -d, s, -c)),
    "gbellmf": lambda a, b, c: ("gbellmf", (a, b, -c)),
    "sigmf": lambda a, c: ("sigmf", (-a, -c)),
    "dsigmf": lambda a, c, b, d: ("dsigmf", (-a, -c, -b, -d)),
    "psigmf": lambda a, c, b, d: ("psigmf", (-a, -c, -b, -d)),
    "pointsmf": lambda *p: (
        "pointsmf",
        tuple(v for k in range(len(p) - 2, -1, -2) for v in (-p[k], p[k + 1])),
    ),
}


def reflected(function):
    return Membership(*MIRRORED[function.shape](*function.parameters))


def mirrored_set(each, name):
    if isinstance(each, LinearFunction):
        return LinearFunction(name, -each.constant, each.coefficients)
    lower = each.lower
    if isinstance(lower, Membership):
        lower = reflected(lower)
    elif lower is not None:
        lower = replace(lower, left=lower.lags[1], right=lower.lags[0])
    return replace(each, name=name, upper=reflected(each.upper), lower=lower)


def renamed(antecedent):
    if isinstance(antecedent, Is):
        return replace(antecedent, set=antecedent.set and f"{antecedent.set}~")
    return type(antecedent)(tuple(map(renamed, antecedent.parts)))


def antisymmetric(system):
    """Return a system with the rules of ``system`` and their mirror images: f(-x) = -f(x)."""

    def both(variable):
        half = max(abs(variable.low), abs(variable.high))
        sets = (*variable.sets, *(mirrored_set(s, f"{s.name}~") for s in variable.sets))
        wide = replace(variable, low=-half, high=half, sets=sets)
        return replace(wide, default=0.0) if isinstance(wide, OutputVariable) else wide

    image = tuple(
        Rule(renamed(r.antecedent), tuple(map(renamed, r.consequents)), r.weight)
        for r in system.rules
    )
    return replace(
        system,
        inputs=tuple(map(both, system.inputs)),
        outputs=tuple(map(both, system.outputs)),
        rules=(*system.rules, *image),
    )


@given(
    systems(defuzzifiers=("centroid", "wtaver", "wtsum"), **CONTINUOUS),
    SEEDS,
    st.sampled_from(["centroid", "cos"]),
)
@examples(50)
def test_symmetric_rule_base_gives_odd_surface(system, seed, reduction):
    """For every type, shape and norm; a footprint may have different lags on its sides."""
    slopes = [s.upper.parameters[0] for v in system.variables for s in v.sets
              if isinstance(s, FuzzySet) and s.upper.shape == "sigmf"]  # fmt: skip
    assume(0.0 not in slopes)  # no vertical side
    symmetric = antisymmetric(system)
    run = Inference(symmetric, reduction=reduction, slices=3, algorithm="eiasc")
    at = oracle.points_in(symmetric, np.random.default_rng(seed), 8)
    here, there = run.batch(at), run.batch(-at)
    strong = np.array([max((f.upper for f in run.fired_rules(*x)), default=0.0) > 1e-6 for x in at])
    scale = np.maximum(oracle.spans(symmetric), np.abs(here).max(axis=(0, 1)))
    ok = here[:, strong] / scale, there[:, strong] / scale
    if system.type == 1 or symmetric.is_sugeno:
        np.testing.assert_allclose(ok[0][0], -ok[1][0], atol=1e-8)
    else:
        np.testing.assert_allclose(ok[0][1], -ok[1][2], atol=1e-7)
        np.testing.assert_allclose(ok[0][0], -ok[1][0], atol=1e-7)


def partition(edges):
    """Return triangles with the given peaks that add up to one everywhere."""
    e = [edges[0], *edges, edges[-1]]
    return tuple(
        FuzzySet(f"s{k}", Membership("trimf", tuple(e[k : k + 3]))) for k in range(len(edges))
    )


PEAKS = st.lists(st.floats(0.05, 1.0), min_size=2, max_size=5).map(
    lambda steps: (np.r_[0.0, np.cumsum(steps)] / sum(steps) * 2 - 1).tolist()
)


@given(PEAKS, PEAKS, st.data())
@examples(60)
def test_monotone_sugeno_rule_base_gives_monotone_surface(first, second, data):
    """Products of partitions of unity: the surface is bilinear between the rules' constants."""
    steps = data.draw(
        st.lists(st.floats(0.0, 1.0), min_size=len(first) * len(second),
                 max_size=len(first) * len(second))
    )  # fmt: skip
    heights = np.cumsum(np.cumsum(np.reshape(steps, (len(first), -1)), axis=0), axis=1)
    inputs = (
        InputVariable("a", -1, 1, partition(first)),
        InputVariable("b", -1, 1, partition(second)),
    )
    functions, rules = [], []
    for (i, j), height in np.ndenumerate(heights):
        functions.append(LinearFunction(f"f{i}_{j}", height))
        antecedent = And((Is("a", f"s{i}"), Is("b", f"s{j}")))
        rules.append(Rule(antecedent, (Is("y", f"f{i}_{j}"),)))
    output = OutputVariable("y", 0, 100, tuple(functions))
    run = Inference(FuzzySystem("m", inputs, (output,), tuple(rules), conjunction="prod"))
    axis = np.linspace(-1, 1, 31)
    surface = run(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1))[..., 0]
    assert (np.diff(surface, axis=0) >= -1e-12).all()
    assert (np.diff(surface, axis=1) >= -1e-12).all()
    corners = run(np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1))[..., 0]
    np.testing.assert_allclose(corners, heights, atol=1e-12)


@given(PEAKS, st.sampled_from([("min", "min"), ("prod", "prod")]))
@examples(60)
def test_monotone_mamdani_rule_base_gives_monotone_curve(peaks, operators):
    """One input, adjacent sets imply adjacent sets: proved by Van Broekhoven & De Baets 2009.

    With more inputs, or rules that skip a set, the centroid need not be monotone.
    """
    evenly = np.linspace(-1, 1, len(peaks)).tolist()
    rules = tuple(Rule(Is("x", f"s{k}"), (Is("y", f"s{k}"),)) for k in range(len(peaks)))
    conjunction, implication = operators
    system = FuzzySystem(
        "m",
        (InputVariable("x", -1, 1, partition(peaks)),),
        (OutputVariable("y", -1, 1, partition(evenly)),),
        rules,
        conjunction,
        implication=implication,
    )
    curve = Inference(system)(np.linspace(-1, 1, 201)[:, None])[:, 0]
    assert (np.diff(curve) >= -1e-12).all()


# --- invariances --------------------

ANY = systems(types=(1, 2, 3), defuzzifiers=("centroid", "wtaver", "wtsum"), **CONTINUOUS)


@given(ANY, SEEDS, st.randoms(use_true_random=False))
@examples(40)
def test_order_of_rules_and_inputs_has_no_effect(system, seed, shuffle):
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    rules, order = list(system.rules), list(range(len(system.inputs)))
    shuffle.shuffle(rules)
    shuffle.shuffle(order)

    def moved(output):
        if not output.is_sugeno:
            return output
        return replace(
            output,
            sets=tuple(
                replace(f, coefficients=tuple(f.coefficients[k] for k in order if f.coefficients))
                for f in output.sets
            ),
        )

    other = replace(
        system,
        rules=tuple(rules),
        inputs=tuple(system.inputs[k] for k in order),
        outputs=tuple(map(moved, system.outputs)),
    )
    run = Inference(system, slices=2)
    strong = np.array([max((f.upper for f in run.fired_rules(*x)), default=0.0) > 1e-6 for x in at])
    here, there = run.batch(at[strong]), Inference(other, slices=2).batch(at[strong][:, order])
    scale = np.maximum(oracle.spans(system), np.abs(here).max(axis=(0, 1), initial=0.0))
    np.testing.assert_allclose(here / scale, there / scale, atol=1e-8)


def scaled(function, by):
    p, shape = function.parameters, function.shape
    if shape == "pointsmf":
        return Membership(shape, tuple(v if k % 2 else v * by for k, v in enumerate(p)))
    if shape == "gbellmf":
        return Membership(shape, (p[0] * by, p[1], p[2] * by))
    if "sig" in shape:
        return Membership(shape, tuple(v * by if k % 2 else v / by for k, v in enumerate(p)))
    return Membership(shape, tuple(v * by for v in p))


@given(ANY, SEEDS, st.sampled_from([2.0**-20, 0.5, 1024.0]))
@examples(40)
def test_unit_of_variable_has_no_effect(system, seed, by):
    """Powers of two scale without rounding, except for denormal numbers."""

    def one(each):
        if isinstance(each, LinearFunction):
            return replace(each, constant=by * each.constant)
        lower = scaled(each.lower, by) if isinstance(each.lower, Membership) else each.lower
        return replace(each, upper=scaled(each.upper, by), lower=lower)

    def unit(variable):
        wide = replace(
            variable,
            low=by * variable.low,
            high=by * variable.high,
            sets=tuple(map(one, variable.sets)),
        )
        default = getattr(variable, "default", None)
        return wide if default is None else replace(wide, default=by * default)

    other = replace(
        system, inputs=tuple(map(unit, system.inputs)), outputs=tuple(map(unit, system.outputs))
    )
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    here, there = Inference(system, slices=2).batch(at), Inference(other, slices=2).batch(by * at)
    np.testing.assert_allclose(by * here, there, rtol=1e-15, atol=1e-300)


def reducible(system):
    """Return the system; for types 2 and 3 with outputs whose defuzzifier is the centroid."""
    if system.type == 1:
        return system
    outputs = (o if o.is_sugeno else replace(o, defuzzifier=None) for o in system.outputs)
    return replace(system, outputs=tuple(outputs))


@given(systems(names=st.from_regex(r"[a-z]{1,6}", fullmatch=True)), SEEDS)
@examples(30)
def test_call_batch_mapping_and_threads_give_identical_results(system, seed):
    system = reducible(system)
    run = Inference(system, samples=31, slices=2)
    at = oracle.points_in(system, np.random.default_rng(seed), 12, beyond=0.3)
    at = at[: len(at) // 3 * 3]
    batch = run.batch(at)
    np.testing.assert_array_equal(run(at), batch[0])
    np.testing.assert_array_equal(
        run(at.reshape(3, -1, at.shape[1])).reshape(batch[0].shape), batch[0]
    )
    np.testing.assert_array_equal(run(np.asfortranarray(at)), batch[0])
    for threads in (2, 5, 100):
        np.testing.assert_array_equal(run.batch(at, threads=threads), batch)
    names = [v.name for v in system.inputs]
    for k, x in enumerate(at):
        np.testing.assert_array_equal(run(*x.tolist()), batch[0, k])
        np.testing.assert_array_equal(run(x), batch[0, k])
        np.testing.assert_array_equal(run.interval(*x), batch[1:, k])
        answer = run(dict(reversed(list(zip(names, x.tolist(), strict=True)))))
        assert list(answer) == [v.name for v in system.outputs]
        np.testing.assert_array_equal(list(answer.values()), batch[0, k])


def test_empty_batch_gives_empty_result():
    run = Inference(paper())
    assert run(np.empty((0, 2))).shape == (0, 3)
    assert run.batch(np.empty((0, 2)), threads=4).shape == (3, 0, 3)


def test_batch_does_not_modify_rows():
    rows = np.array([[5.0, -5.0]])
    Inference(paper()).batch(rows)
    assert rows.tolist() == [[5.0, -5.0]]


@given(systems(types=(1, 2), hedges=HEDGES, **CONTINUOUS), SEEDS)
@examples(80)
def test_fired_rules_have_correct_strengths(system, seed):
    system = reducible(system)
    run = Inference(system, samples=11)
    x = oracle.points_in(system, np.random.default_rng(seed), 1, beyond=0.2)[0]
    fired = run.fired_rules(*x)
    assert [f.upper for f in fired] == sorted((f.upper for f in fired), reverse=True)
    found = {f.number: f for f in fired}
    for number, rule in enumerate(system.rules, 1):
        pair = oracle.strength(system, rule.antecedent, oracle.clamped(system, x))
        low, high = (rule.weight * s for s in pair)
        each = found.pop(number, None)
        if each is None:
            assert high < 1e-12
        else:
            assert each.rule is rule
            assert (each.lower, each.upper) == pytest.approx((low, high), abs=1e-9)
    assert not found


@given(systems(types=(1,), sugeno=(False,), aggregations=("max",), max_rules=3), SEEDS)
@examples(30)
def test_duplicate_rule_has_no_effect_under_max(system, seed):
    twice = replace(system, rules=system.rules * 2)
    at = oracle.points_in(system, np.random.default_rng(seed), 10)
    options = {"samples": 31}
    np.testing.assert_array_equal(Inference(system, **options)(at), Inference(twice, **options)(at))
