"""Agreement with other fuzzy libraries on random systems.

They are no dependencies of the project: the tests are skipped if they are not installed.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import strategies as st

from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rules import And, Is, Or
from omnidrive.fuzzy.variables import Footprint
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import systems

SEEDS = st.integers(0, 2**32 - 1)
NAMES = st.from_regex(r"[a-z]{2,6}[0-9]", fullmatch=True)
SHARED = {
    "sugeno": (False,),
    "defuzzifiers": ("centroid",),
    "disjunctions": ("max",),  # of simpful; pyit2fls has no "or" in antecedents
    "aggregations": ("max",),
    "defaults": False,
    "hedges": (),
    "negated_consequents": False,
    "names": NAMES,
}


def without_vertical_sides(system):
    """Return the system without vertical sides.

    At a vertical side, simpful has degree 1 on its left, and both libraries omit its end.
    """

    def one(each):
        function = each.upper
        if function.shape not in {"trimf", "trapmf"}:
            return each
        p, width = function.parameters, function.parameters[-1] - function.parameters[0]
        apart = tuple(v + 0.1 * k * width for k, v in enumerate(p))
        return replace(each, upper=Membership(function.shape, apart))

    def of(variable):
        if getattr(variable, "is_sugeno", False):
            return variable
        return replace(variable, sets=tuple(map(one, variable.sets)))

    return replace(
        system, inputs=tuple(map(of, system.inputs)), outputs=tuple(map(of, system.outputs))
    )


def clearly_fires(system, x):
    """Whether rules fire for every output: otherwise the peers return 0 or nothing."""
    for output in system.outputs:
        at = oracle.even(output, 101)
        if oracle.aggregate(system, output, x, at)[1].max() < 1e-4:
            return False
    return True


# --- simpful --------------------


def simpful_text(antecedent):
    if isinstance(antecedent, Is):
        return f"({antecedent.variable} IS {antecedent.set})"
    word = " AND " if isinstance(antecedent, And) else " OR "
    first, *others = map(simpful_text, antecedent.parts)
    for other in others:
        first = f"({first}{word}{other})"  # simpful accepts two operands
    return first


def simpful_system(system):
    simpful = pytest.importorskip("simpful")

    def function(f):
        p = f.parameters
        return {
            "trimf": lambda: simpful.Triangular_MF(*p),
            "trapmf": lambda: simpful.Trapezoidal_MF(*p),
            "gaussmf": lambda: simpful.Gaussian_MF(p[1], p[0]),
            "sigmf": lambda: simpful.Sigmoid_MF(p[1], p[0]),
        }[f.shape]()

    operators = ["AND_PRODUCT"] if system.conjunction == "prod" else None
    peer = simpful.FuzzySystem(operators=operators, show_banner=False)
    for v in system.variables:
        if v in system.outputs and system.is_sugeno:
            for f in v.sets:
                terms = zip(f.coefficients, system.inputs, strict=False)
                text = " + ".join([repr(f.constant), *(f"({c!r})*({u.name})" for c, u in terms)])
                peer.set_output_function(f"{v.name}_{f.name}", text)
            continue
        sets = [simpful.FuzzySet(function=function(s.upper), term=s.name) for s in v.sets]
        peer.add_linguistic_variable(
            v.name, simpful.LinguisticVariable(sets, universe_of_discourse=[v.low, v.high])
        )
    for rule in system.rules:
        for term in rule.consequents:
            name = f"{term.variable}_{term.set}" if system.is_sugeno else term.set
            peer.add_rules(
                [f"IF {simpful_text(rule.antecedent)} THEN ({term.variable} IS {name})"
                 + (f" WEIGHT {rule.weight!r}" if rule.weight != 1.0 else "")]
            )  # fmt: skip
    return peer


def simpful_outputs(system, peer, infer, x):
    for v, value in zip(system.inputs, x, strict=True):
        peer.set_variable(v.name, float(value))
    found = infer([o.name for o in system.outputs])
    return np.array([found[o.name] for o in system.outputs])


SIMPFUL = SHARED | {
    "types": (1,),  # no "not": its parser fails for "(NOT (a)) OR (NOT (b))"
    "conjunctions": ("min", "prod"),
    "shapes": ("trimf", "trapmf", "gaussmf", "sigmf"),
    "implications": ("min",),
    "weights": False,  # its parser accepts few forms of a weight
    "max_sets": 2,
    "max_rules": 3,
}


@given(systems(**SIMPFUL), SEEDS)
@examples(25)
def test_simpful_matches_on_101_samples(system, seed):
    """Mamdani: on 101 points, simpful's sum is Matlab's."""
    system = without_vertical_sides(system)
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    assume(clearly_fires(system, x))
    peer = simpful_system(system)
    expected = simpful_outputs(
        system, peer, lambda names: peer.Mamdani_inference(names, subdivisions=101), x
    )
    scale = oracle.spans(system)
    found = Inference(system, centroid="matlab")(*x)
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-10)


@given(systems(**SIMPFUL | {"sugeno": (True,), "defuzzifiers": ("wtaver",)}), SEEDS)
@examples(60)
def test_simpful_matches_on_sugeno(system, seed):
    """Without weights: simpful omits them from the divisor."""
    system = without_vertical_sides(system)
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    for output in system.outputs:
        fired = [u for *_, u in oracle.consequents(system, output, x)]
        assume(fired)
        assume(max(fired) > 1e-4)
    peer = simpful_system(system)
    expected = simpful_outputs(system, peer, peer.Sugeno_inference, x)
    np.testing.assert_allclose(Inference(system)(*x), expected, rtol=1e-9, atol=1e-7)


# --- pyit2fls --------------------

PYIT2FLS = SHARED | {
    "shapes": ("trimf", "gaussmf"),
    "nesting": 0,
    "weights": False,  # it has no weights
    "max_outputs": 1,  # its centre of sets requires a consequent for every output in every rule
}


def without_disjunctions(system):
    """Return the system with "and" for every "or", which pyit2fls does not have."""

    def one(rule):
        c = rule.antecedent
        return replace(rule, antecedent=And(c.parts) if isinstance(c, Or) else c)

    return replace(system, rules=tuple(map(one, system.rules)))


def expressible_in_pyit2fls(system):
    """Return the system with footprints of pyit2fls: narrower Gaussians, triangles with lags."""

    def one(each):
        p, lower = each.upper.parameters, each.lower
        if each.upper.shape == "gaussmf":
            lower = Membership("gaussmf", (0.6 * p[0], p[1]))
        elif isinstance(lower, Membership):
            lower = Footprint(0.8, 0.1, 0.3)
        else:
            lower = replace(lower, left=min(lower.lags[0], 0.5), right=min(lower.lags[1], 0.5))
        return replace(each, lower=lower)

    def of(variable):
        return replace(variable, sets=tuple(map(one, variable.sets)))

    return replace(
        system, inputs=tuple(map(of, system.inputs)), outputs=tuple(map(of, system.outputs))
    )


def pyit2fls_curves(each):
    """Return upper and lower function with parameters in pyit2fls' form."""
    import pyit2fls

    p, lag = each.upper.parameters, each.lower
    if each.upper.shape == "gaussmf":
        upper = [p[1], p[0], 1.0]
        narrow = [p[1], each.lower.parameters[0], 1.0] if isinstance(lag, Membership) else upper
        return pyit2fls.gaussian_mf, upper, narrow
    a, b, c = p
    upper = lower = [a, b, c, 1.0]
    if isinstance(lag, Footprint):
        left, right = lag.lags
        lower = [a + left * (b - a), b, c - right * (c - b), lag.scale]
    return pyit2fls.tri_mf, upper, lower


def add_rules(system, peer, sets):
    for v in system.inputs:
        peer.add_input_variable(v.name)
    for v in system.outputs:
        peer.add_output_variable(v.name)
    for rule in system.rules:
        antecedent = rule.antecedent
        parts = [antecedent] if isinstance(antecedent, Is) else antecedent.parts
        peer.add_rule(
            [(t.variable, sets[t.variable, t.set]) for t in parts],
            [(t.variable, sets[t.variable, t.set]) for t in rule.consequents],
        )


@given(systems(**PYIT2FLS, types=(1,), conjunctions=("min",), implications=("min",))
       | systems(**PYIT2FLS, types=(1,), conjunctions=("prod",), implications=("prod",)),
       SEEDS)  # fmt: skip
@examples(60)
def test_pyit2fls_matches_on_type_1(system, seed):
    """It integrates by the trapezoid rule: on fine samples, this is the exact centroid."""
    system = without_vertical_sides(without_disjunctions(system))
    pyit2fls = pytest.importorskip("pyit2fls")
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    assume(clearly_fires(system, x))
    engine = {"min": "Minimum", "prod": "Product"}[system.conjunction]
    peer = pyit2fls.T1Mamdani(engine=engine)
    sets = {}
    for v in system.variables:
        domain = np.linspace(v.low, v.high, 20_001)
        for s in v.sets:
            mf, upper, _ = pyit2fls_curves(s)
            sets[v.name, s.name] = pyit2fls.T1FS(domain, mf, upper)
    add_rules(system, peer, sets)
    named = dict(zip((v.name for v in system.inputs), x.tolist(), strict=True))
    crisp = peer.evaluate(named)[1][system.outputs[0].name]
    fine = Inference(system) if Inference(system).options.centroid == "exact" else Inference(
        system, samples=20_001
    )  # fmt: skip
    # the sum rule weights both ends with 1, the trapezoid rule with 1/2: 1/20001 of the area
    assert fine(*x)[0] == pytest.approx(crisp, abs=2e-2 * oracle.spans(system)[0] * 0.01)


TYPE_2 = PYIT2FLS | {"types": (2,), "algorithms": ("km",)}


@given(
    (systems(**TYPE_2, conjunctions=("min",), implications=("min",))
     | systems(**TYPE_2, conjunctions=("prod",), implications=("prod",))),
    SEEDS,
    st.sampled_from([("Centroid", "centroid"), ("CoSet", "cos")]),
    st.sampled_from(["KM", "EIASC"]),
)  # fmt: skip
@examples(60, suppress=(HealthCheck.filter_too_much,))
def test_pyit2fls_matches_on_type_2(system, seed, method, algorithm):
    """Its EKM has errors up to 1e-2 and may not terminate; its KM stops within 1e-6 of the end.

    Gaussians have a narrower Gaussian as lower function, triangles a lag: it supports both.
    """
    pyit2fls = pytest.importorskip("pyit2fls")
    system = expressible_in_pyit2fls(without_vertical_sides(without_disjunctions(system)))
    x = oracle.points_in(system, np.random.default_rng(seed), 1)[0]
    assume(clearly_fires(system, x))
    output = system.outputs[0]
    assume(output.high - output.low > 1.0)  # its KM stops within 1e-6, independent of the range
    at = oracle.even(output, 101)
    lower = oracle.aggregate(system, output, x, at)[0]
    # without lower degrees, it returns the second and the last but one point as the ends
    assume(lower.max() > 1e-4)
    for each, *_ in oracle.consequents(system, output, x):
        assume(oracle.bounds(each, at)[0].max() > 1e-4)
    if method[1] == "cos":
        assume(max(low for *_, low, _ in oracle.consequents(system, output, x)) > 1e-4)
    norm = {"min": pyit2fls.min_t_norm, "prod": pyit2fls.product_t_norm}[system.conjunction]
    peer = pyit2fls.IT2Mamdani(norm, pyit2fls.max_s_norm, method=method[0], algorithm=algorithm)
    sets = {}
    for v in system.variables:
        domain = oracle.even(v, 101)
        for s in v.sets:
            mf, upper, low = pyit2fls_curves(s)
            sets[v.name, s.name] = pyit2fls.IT2FS(domain, mf, upper, mf, low)
    add_rules(system, peer, sets)
    named = dict(zip((v.name for v in system.inputs), x.tolist(), strict=True))
    found = peer.evaluate(named)
    expected = (found if method[1] == "cos" else found[1])[output.name]
    run = Inference(system, centroid="matlab", reduction=method[1], algorithm="km")
    mine = [end[0] for end in run.interval(*x)]
    tolerance = (1e-4 if algorithm == "KM" else 1e-6) * (output.high - output.low)
    assert mine == pytest.approx(list(expected), abs=tolerance)
