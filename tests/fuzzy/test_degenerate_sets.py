"""Sets without width: their degrees, and outputs of fuzzy singletons, from every format."""

import math
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy import Inference
from omnidrive.fuzzy.aggregated_output import aggregated_outputs
from omnidrive.fuzzy.files.fcl import read_fcl, write_fcl
from omnidrive.fuzzy.files.fis import read_fis, write_fis
from omnidrive.fuzzy.files.fll import read_fll, write_fll
from omnidrive.fuzzy.files.fml import read_fml, write_fml
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rule_text import parse_rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Footprint,
    FuzzySet,
    InputVariable,
    OutputVariable,
    Secondary,
)
from tests.fuzzy import oracle
from tests.shared_data import shared

N = FuzzySet("n", Membership("trimf", (-30, -10, 10)))
P = FuzzySet("p", Membership("trimf", (-10, 10, 30)))
BACK = ("trimf", (-50, -50, -50))
AHEAD = ("trimf", (20, 20, 20))


def steps(back=BACK, ahead=AHEAD, rules=("n", "p"), **output):
    """Return a system of one input: n concludes back, p concludes ahead.

    At err = 4 the strengths are 0.3 and 0.7; at err = -4, 0.7 and 0.3; at 0, both 0.5.
    """
    sets = (FuzzySet("back", Membership(*back)), FuzzySet("ahead", Membership(*ahead)))
    return FuzzySystem(
        "steps",
        (InputVariable("err", -10, 10, (N, P)),),
        (OutputVariable("drive", -50, 50, sets, **output),),
        tuple(
            parse_rule(f"if err is {each} then drive is {name}")
            for each, name in zip(rules, ("back", "ahead"), strict=True)
        ),
    )


BOTH = pytest.mark.parametrize("centroid", ["exact", "matlab"])


@pytest.mark.parametrize(
    ("shape", "parameters", "at", "degrees"),
    [
        ("trimf", (2, 2, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("trapmf", (2, 2, 2, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("trapmf", (1, 1, 3, 3), (0.9, 1, 3, 3.1), (0, 1, 1, 0)),
        ("pimf", (2, 2, 2, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("pimf", (1, 1, 3, 3), (0.9, 1, 3, 3.1), (0, 1, 1, 0)),
        ("pimf", (3, 1, 5, 4), (1.9, 2, 4.5, 4.6), (0, 1, 1, 0)),  # Matlab: steps at 2 and 4.5
        ("pimf", (0, 4, 2, 6), (3,), (0.875**2,)),  # Matlab: the product of both sides
        ("smf", (2, 2), (1.9, 2, 2.1), (0, 1, 1)),
        ("smf", (5, 1), (2.9, 3, 3.1), (0, 1, 1)),  # Matlab: x >= (a + b)/2
        ("zmf", (2, 2), (1.9, 2, 2.1), (1, 1, 0)),
        ("zmf", (5, 1), (2.9, 3, 3.1), (1, 1, 0)),
        ("linsmf", (2, 2), (1.9, 2, 2.1), (0, 1, 1)),
        ("linzmf", (2, 2), (1.9, 2, 2.1), (1, 1, 0)),
        ("gaussmf", (0, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("gaussmf", (0, 0), (-1e-9, 0, 1e-9), (0, 1, 0)),
        ("gauss2mf", (0, 2, 1, 3), (1.9, 2, 3, 4), (0, 1, 1, math.exp(-0.5))),
        ("gauss2mf", (1, 2, 0, 3), (1, 2, 3, 3.1), (math.exp(-0.5), 1, 1, 0)),
        ("gauss2mf", (0, 2, 0, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("cosinemf", (0, 2), (1.9, 2, 2.1), (0, 1, 0)),
        ("cosinemf", (2, 1), (-1, 0, 1, 2, 3.1), (0, 0.5, 1, 0.5, 0)),
        ("pointsmf", (2, 0, 2, 0.5, 2, 0), (1.9, 2, 2.1), (0, 0.5, 0)),
    ],
)
def test_degrees(shape, parameters, at, degrees):
    function = Membership(shape, parameters)
    assert function(np.array(at)) == pytest.approx(degrees, abs=1e-15)
    assert oracle.curve(function, at) == pytest.approx(degrees, abs=1e-15)


@BOTH
@pytest.mark.parametrize(
    "singleton",
    [
        lambda x: ("trimf", (x, x, x)),
        lambda x: ("trapmf", (x, x, x, x)),
        lambda x: ("pimf", (x, x, x, x)),
        lambda x: ("pimf", (x + 1, x - 1, x + 2, x - 2)),
        lambda x: ("gaussmf", (0, x)),
        lambda x: ("gauss2mf", (0, x, 0, x)),
        lambda x: ("cosinemf", (0, x)),
        lambda x: ("pointsmf", (x, 0, x, 1, x, 0)),
    ],
)
def test_centroid_of_singletons(singleton, centroid):
    infer = Inference(steps(singleton(-50), singleton(20)), centroid=centroid)
    assert infer(4.0)[0] == pytest.approx(0.3 * -50 + 0.7 * 20, abs=1e-13)
    between = Inference(steps(singleton(-12.345), singleton(33.33)), centroid=centroid)
    assert between(4.0)[0] == pytest.approx(0.3 * -12.345 + 0.7 * 33.33, abs=1e-13)
    assert Inference(steps(singleton(-50), singleton(20)))(4.0)[0] == infer(4.0)[0]  # the default


@BOTH
@pytest.mark.parametrize(
    ("defuzzifier", "at_4", "at_0"),
    [
        ("centroid", -1.0, -15.0),
        ("bisector", 20.0, -50.0),
        ("mom", 20.0, -15.0),
        ("som", 20.0, 20.0),
        ("lom", 20.0, -50.0),
        ("lm", 20.0, -50.0),
        ("rm", 20.0, 20.0),
    ],
)
def test_defuzzifiers_of_singletons(defuzzifier, at_4, at_0, centroid):
    infer = Inference(steps(defuzzifier=defuzzifier), centroid=centroid)
    assert infer(4.0)[0] == pytest.approx(at_4, abs=1e-13)
    assert infer(0.0)[0] == pytest.approx(at_0, abs=1e-13)


@pytest.mark.parametrize(
    ("aggregation", "weight"), [("max", 0.7), ("sum", 1.0), ("probor", 0.79), ("bsum", 1.0)]
)
def test_aggregation_at_one_point(aggregation, weight):
    """Two rules conclude singletons at 20, with 0.3 and 0.7, and one at -50 with 0.5."""
    system = steps(AHEAD, AHEAD, aggregation=aggregation)
    third = FuzzySet("third", Membership(*BACK))
    output = replace(system.outputs[0], sets=(*system.outputs[0].sets, third))
    rule = parse_rule("if err is any then drive is third with 0.5")
    system = replace(system, outputs=(output,), rules=(*system.rules, rule))
    expected = (weight * 20 + 0.5 * -50) / (weight + 0.5)
    assert Inference(system)(4.0)[0] == pytest.approx(expected, abs=1e-13)
    scaled = replace(system, implication="prod")
    assert Inference(scaled)(4.0)[0] == pytest.approx(expected, abs=1e-13)


def test_singleton_beside_an_area():
    system = steps(ahead=("trimf", (0, 20, 40)))
    assert Inference(system)(4.0)[0] == pytest.approx(20.0, abs=1e-12)  # no area
    at = np.linspace(-50, 50, 101)
    degrees = np.minimum(0.7, oracle.curve(Membership("trimf", (0, 20, 40)), at))
    degrees[0] = 0.3  # Matlab: one sample
    sampled = Inference(system, centroid="matlab")(4.0)[0]
    assert sampled == pytest.approx((degrees * at).sum() / degrees.sum(), abs=1e-12)
    for defuzzifier, at_4, at_minus_4 in (
        ("mom", 20.0, -50.0),
        ("lm", 14.0, -50.0),
        ("rm", 26.0, -50.0),
        ("bisector", 20.0, 20.0),
        ("centroid", 20.0, 20.0),
    ):
        infer = Inference(steps(ahead=("trimf", (0, 20, 40)), defuzzifier=defuzzifier))
        assert infer(4.0)[0] == pytest.approx(at_4, abs=1e-12)
        assert infer(-4.0)[0] == pytest.approx(at_minus_4, abs=1e-12)


def test_maxima_of_equal_height():
    infer = Inference(steps(ahead=("trimf", (0, 20, 40)), defuzzifier="lom"))
    assert infer(0.0)[0] == -50.0  # the triangle is clipped at 0.5 from 10 to 30
    assert Inference(replace(infer.system, implication="prod"))(0.0)[0] == -50.0


@BOTH
def test_ends_of_the_range(centroid):
    touching = steps(("trimf", (-80, -50, -50)), ("trapmf", (50, 50, 80, 90)))
    infer = Inference(touching, centroid=centroid)
    assert infer(4.0)[0] == pytest.approx(0.3 * -50 + 0.7 * 50, abs=1e-12)
    outside = steps(("trimf", (-60, -60, -60)), ("trimf", (70, 70, 70)), default=7.0)
    assert Inference(outside, centroid=centroid)(4.0)[0] == 7.0
    with pytest.raises(InvalidInput, match="no rule fires"):
        Inference(outside, centroid=centroid, no_rule="raise")(4.0)
    one = steps(("trimf", (-60, -60, -60)), AHEAD)
    assert Inference(one, centroid=centroid)(4.0)[0] == 20.0


@BOTH
@pytest.mark.parametrize("reduction", ["centroid", "cos"])
@pytest.mark.parametrize("algorithm", ["km", "ekm", "iasc", "eiasc"])
def test_type_2(reduction, algorithm, centroid):
    """The strengths lie in [0.15, 0.3] and [0.35, 0.7]; the points have no width."""
    system = steps().with_footprint(Footprint(0.5), Footprint(0.9))
    infer = Inference(system, reduction=reduction, algorithm=algorithm, centroid=centroid)
    least, greatest = infer.interval(4.0)
    assert least[0] == pytest.approx((0.3 * -50 + 0.35 * 20) / 0.65, abs=1e-12)
    assert greatest[0] == pytest.approx((0.15 * -50 + 0.7 * 20) / 0.85, abs=1e-12)


def test_type_3():
    two = steps().with_footprint(Footprint(0.5), Footprint(0.9))
    flat = steps().with_footprint(Footprint(0.5), Footprint(0.9), Secondary(math.inf))
    assert Inference(flat)(4.0)[0] == pytest.approx(Inference(two)(4.0)[0], abs=1e-12)
    three = Inference(steps().with_footprint(Footprint(0.5), Footprint(0.9), Secondary()))
    least, greatest = Inference(two).interval(4.0)
    assert least[0] < three(4.0)[0] < greatest[0]


def test_complement_of_a_singleton_has_an_area():
    system = steps()
    rules = (system.rules[0], parse_rule("if err is p then drive is not ahead"))
    assert Inference(replace(system, rules=rules))(4.0)[0] == pytest.approx(0.0, abs=1e-12)


def test_singletons_in_antecedents():
    inputs = (InputVariable("err", -10, 10, (N, FuzzySet("p", Membership("trimf", (3, 3, 3))))),)
    system = replace(steps(), inputs=inputs)
    assert Inference(system)(3.0)[0] == pytest.approx((0.35 * -50 + 1 * 20) / 1.35, abs=1e-12)
    assert Inference(system)(3.1)[0] == pytest.approx(-50.0, abs=1e-12)
    uncertain = system.with_footprint(Footprint(1.0, 0.2))
    assert Inference(uncertain).interval(3.0)[1][0] > 0.0


@BOTH
def test_aggregated_output_has_the_points(centroid):
    (found,) = aggregated_outputs(Inference(steps(), centroid=centroid), 4.0)
    x, degree = found.upper
    assert x[degree > 0].tolist() == [-50, -50, 20, 20]
    assert degree[degree > 0] == pytest.approx([0.3, 0.3, 0.7, 0.7])
    mixed = Inference(steps(ahead=("trimf", (0, 20, 40))))
    (found,) = aggregated_outputs(mixed, 4.0)
    assert np.all(np.diff(found.upper[0]) >= 0)
    assert found.upper[1][found.upper[0] == -50].max() == pytest.approx(0.3)


def test_shared_files():
    for suffix, read in (("fis", read_fis), ("fcl", read_fcl), ("xml", read_fml)):
        path = shared(f"cases/07-singleton-sets-refused/steps.{suffix}")
        assert Inference(read(path.read_text(encoding="utf-8")))(4.0)[0] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("write", "read"),
    [
        (write_fis, read_fis),
        (write_fll, read_fll),
        (write_fcl, read_fcl),
        (lambda s: write_fcl(s, "fuzzylite"), read_fcl),
        (write_fml, read_fml),
    ],
)
def test_round_trips(write, read):
    system = steps(("trapmf", (-50,) * 4))
    if read is not read_fis:
        system = replace(system, outputs=(replace(system.outputs[0], default=3.0),))
    assert read(write(system)) == system


def test_reversed_sides_round_trip():
    """fuzzylite's S shape is a step at its start if that is beyond its end, not in the middle."""
    reversed_ = FuzzySet("n", Membership("smf", (5, 1)))
    system = replace(steps(), inputs=(InputVariable("err", -10, 10, (reversed_, P)),))
    at = np.array([[2.9], [3.0], [3.1]])
    for write, read in ((write_fis, read_fis), (write_fll, read_fll), (write_fml, read_fml)):
        assert np.array_equal(Inference(read(write(system)))(at), Inference(system)(at))
    text = write_fll(steps()).replace("term: n Triangle -30.0 -10.0 10.0", "term: n SShape 5 1")
    assert read_fll(text).inputs[0].sets[0].upper == Membership("smf", (5, 5))


def test_fml_shapes():
    text = write_fml(steps())
    old = '<triangularShape param1="-50.0" param2="-50.0" param3="-50.0"/>'
    assert old in text
    for shape in (
        '<singletonShape param1="-50"/>',
        '<rectangularShape param1="-50" param2="-50"/>',
        '<gaussianShape param1="-50" param2="0"/>',
        '<trapezoidShape param1="-50" param2="-50" param3="-50" param4="-50"/>',
        '<pointSetShape><point x="-50" y="0"/><point x="-50" y="1"/><point x="-50" y="0"/>'
        "</pointSetShape>",
    ):
        assert Inference(read_fml(text.replace(old, shape)))(4.0)[0] == pytest.approx(-1.0)
    with pytest.raises(InvalidFuzzyFile, match="expected only param1"):
        read_fml(text.replace(old, '<singletonShape param1="-50" param2="-50"/>'))


FLL = """\
Engine: mix
InputVariable: err
  range: -10 10
  term: n Triangle -30 -10 10
  term: p Triangle -10 10 30
InputVariable: unused
  range: -inf inf
OutputVariable: drive
  range: -50 50
  aggregation: Maximum
  defuzzifier: WeightedAverage TakagiSugeno
  term: back Constant -50
  term: ahead Constant 20
RuleBlock:
  rule: if err is n then drive is back
  rule: if err is p then drive is ahead
  rule: if err is any then drive is ahead with 0.5
"""


def test_fll_aggregation_of_constants():
    """The strengths of ``ahead`` are 0.7 and 0.5; fuzzylite aggregates them before the mean."""
    assert Inference(read_fll(FLL))(4.0, 99.0)[0] == pytest.approx((0.3 * -50 + 0.7 * 20) / 1.0)
    summed = read_fll(FLL.replace("Maximum", "UnboundedSum"))
    assert Inference(summed)(4.0, 99.0)[0] == pytest.approx((0.3 * -50 + 1.2 * 20) / 1.5)
    with pytest.raises(InvalidFuzzyFile, match="rules with one consequent"):
        read_fll(FLL.replace("Constant 20", "Linear 1 0 20"))
    with pytest.raises(InvalidFuzzyFile, match="rules with one consequent"):
        read_fll(FLL.replace("Constant 20", "Constant -50"))


def test_fll_hybrid_of_both_kinds_of_outputs():
    other = """\
OutputVariable: power
  range: 0 10
  aggregation: Maximum
  defuzzifier: Centroid 200
  term: low Rectangle 2 2
  term: high Cosine 7 4
"""
    text = FLL.replace("RuleBlock:\n", other + "RuleBlock:\n  implication: Minimum\n").replace(
        "is back", "is back and power is low"
    )
    infer = Inference(read_fll(text))
    assert infer(4.0, 0.0).tolist() == pytest.approx([-1.0, 2.0])
    high = Inference(read_fll(text.replace("power is low", "power is high")))
    assert high(-10.0, 0.0)[1] == pytest.approx(7.0, abs=1e-12)
