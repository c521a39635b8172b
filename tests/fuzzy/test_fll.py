from dataclasses import replace
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files.fll import read_fll, write_fll
from omnidrive.fuzzy.files.fll.writer import FUNCTIONS
from omnidrive.fuzzy.membership import SHAPES, Membership
from omnidrive.fuzzy.rules import And, Is, Or
from omnidrive.fuzzy.variables import Footprint, LinearFunction
from tests.examples import examples
from tests.fuzzy.mutations import mutated
from tests.fuzzy.systems import IDENTIFIERS, systems

HEATER = """\
Engine: heater: the small one  # a comment
  description: made for this test
InputVariable: room
  enabled: true
  range: -10.0 40.0
  lock-range: false
  term: cold ZShape 5 18
  term: warm Bell 22.0 4.0 3.0 1.0
  term: hot Ramp 24 30
  term: cool Ramp 18 12
InputVariable: sky
  range: 0 1
  term: dark Trapezoid -inf 0 0.2 0.4
  term: clear Rectangle 0.6 1
  term: bright Discrete 0.5 0 0.75 0.5 1 1
OutputVariable: power
  enabled: true
  range: 0.000 100.000
  lock-range: true
  aggregation: AlgebraicSum
  defuzzifier: SmallestOfMaximum 200
  default: nan
  lock-previous: false
  term: low Gaussian 10.0 20.0
  term: high SigmoidDifference 50 0.5 0.4 90
RuleBlock: first
  conjunction: AlgebraicProduct
  disjunction: none
  implication: Minimum
  activation: General
  rule: if room is cold and sky is not very dark then power is high with 0.5
RuleBlock:
  conjunction: none
  disjunction: Maximum
  implication: Minimum
  rule: if room is seldom warm or sky is any then power is low
"""

MIXER = """\
InputVariable: a
range: 0 1
term: on Binary 0.5 inf
term: off Binary 0.5 -inf
InputVariable: b
range: 0 1
term: on Triangle 0 1 2
OutputVariable: y
range: 0 10
aggregation: none
defuzzifier: WeightedAverage TakagiSugeno
default: 3
term: flat Constant 7
term: tilted Linear 1 2 3
term: bare Linear 1 2
RuleBlock:
conjunction: Minimum
implication: none
rule: if a is on and b is on then y is tilted
rule: if a is off then y is flat
rule: if b is on then y is flat
"""

OLD = """\
Engine: of fuzzylite 5
InputVariable: a
  range: 0 1
  term: on Triangle 0 1 2
OutputVariable: y
  range: 0 10
  accumulation: Maximum
  defuzzifier: Centroid 200
  default: 0.5
  lock-valid: false
  term: up Triangle 0 1 2
RuleBlock:
  conjunction: none
  disjunction: none
  activation: AlgebraicProduct
  rule: if a is on then y is up
"""


def test_read_mamdani():
    system = read_fll(HEATER)
    room, sky = system.inputs
    assert system.name == "heater: the small one"
    assert (room.low, room.high) == (-10.0, 40.0)
    assert [each.upper for each in (*room.sets, *sky.sets)] == [
        Membership("zmf", (5, 18)),
        Membership("gbellmf", (4, 3, 22)),
        Membership("linsmf", (24, 30)),
        Membership("linzmf", (12, 18)),
        Membership("linzmf", (0.2, 0.4)),
        Membership("trapmf", (0.6, 0.6, 1, 1)),
        Membership("pointsmf", (0.5, 0, 0.75, 0.5, 1, 1)),
    ]
    (power,) = system.outputs
    assert (power.aggregation, power.defuzzifier, power.default) == ("probor", "lm", None)
    assert [each.upper for each in power.sets] == [
        Membership("gaussmf", (20, 10)),
        Membership("dsigmf", (0.5, 50, 0.4, 90)),
    ]
    assert (system.conjunction, system.disjunction, system.implication) == ("prod", "max", "min")
    first, second = system.rules
    assert first.antecedent == And((Is("room", "cold"), Is("sky", "dark", ("not", "very"))))
    assert first.consequents == (Is("power", "high"),)
    assert first.weight == 0.5
    assert second.antecedent == Or((Is("room", "warm", ("seldom",)), Is("sky", "", ("any",))))


def test_read_sugeno():
    system = read_fll(MIXER)
    (output,) = system.outputs
    assert output.sets == (
        LinearFunction("flat", 7.0),
        LinearFunction("tilted", 3.0, (1.0, 2.0)),
        LinearFunction("bare", 0.0, (1.0, 2.0)),
    )
    assert (output.defuzzifier, output.default) == ("wtaver", 3.0)
    on, off = system.inputs[0].sets
    assert [on.upper(x) for x in (0.4, 0.5, 0.6)] == [0.0, 1.0, 1.0]
    assert [off.upper(x) for x in (0.4, 0.5, 0.6)] == [1.0, 1.0, 0.0]


def test_read_fuzzylite_5():
    system = read_fll(OLD)
    assert system.implication == "prod"
    assert system.outputs[0].aggregation == "max"
    assert system.outputs[0].default == 0.5


@pytest.mark.parametrize("text", [HEATER, MIXER, OLD])
def test_read_write_read(text):
    system = read_fll(text)
    assert read_fll(write_fll(system)) == system


def as_read(system):
    """Return the system as it is read: ineffective aggregations as max."""
    return replace(
        system,
        outputs=tuple(
            replace(o, aggregation="max") if o.is_sugeno and o.aggregation != "sum" else o
            for o in system.outputs
        ),
    )


@examples(60)
@given(
    systems(
        types=(1,),
        names=IDENTIFIERS.filter(lambda name: name not in FUNCTIONS),
        defuzzifiers=("centroid", "bisector", "mom", "lm", "rm", "wtaver", "wtsum"),
        negated_consequents=False,
    )
)
def test_round_trip(system):
    assert read_fll(write_fll(system)) == as_read(system)


@pytest.mark.parametrize(
    ("old", "new", "position", "message"),
    [
        ("cold ZShape 5 18", "cold Arc 5 18", "line 7, column 14", "Arc"),
        ("cold ZShape 5 18", "cold ZShape 5 18 0.5", "line 7, column 14", "height of 0.5"),
        ("cold ZShape 5 18", "cold ZShape 5", "line 7, column 14", "expected 2 parameters"),
        ("cold ZShape 5 18", "cold ZShape 5 x", "line 7, column 23", "number"),
        ("cold ZShape 5 18", "cold ZShape 5 nan", "line 7, column 23", "number"),
        ("cold ZShape 5 18", "cold ZShape 5 inf", "line 7, column 14", "finite"),
        ("cold ZShape 5 18", "cold Constant 5", "line 3", "must be fuzzy sets"),
        ("cold ZShape 5 18", "cold Function x", "line 7, column 14", "Function"),
        ("cold ZShape 5 18", "warm ZShape 5 18", "line 3", "'warm' is there twice"),
        ("hot Ramp 24 30", "hot Ramp 24 24", "line 9, column 13", "no direction"),
        ("InputVariable: sky", "InputVariable: room", "", "'room' is there twice"),
        ("range: -10.0 40.0", "range: 4 4", "line 3", "must have a width"),
        ("range: -10.0 40.0", "range: 4", "line 5, column 10", "two numbers"),
        ("range: -10.0 40.0", "reach: 4", "line 5, column 3", "'reach'"),
        ("  lock-range: false", "  range: 0 1", "line 6, column 3", "twice"),
        ("enabled: true", "enabled: false", "line 4, column 3", "not enabled"),
        ("enabled: true", "enabled: yes", "line 4, column 12", "true or false"),
        ("lock-previous: false", "lock-previous: true", "line 23", "previous value"),
        ("default: nan", "default: 300", "line 19, column 3", "may leave its range"),
        ("SmallestOfMaximum 200", "WeightedAverage", "line 16", "of fuzzy sets"),
        ("SmallestOfMaximum 200", "none", "line 16", "expected a defuzzifier"),
        ("SmallestOfMaximum 200", "Middle", "line 21, column 16", "'Middle'"),
        ("aggregation: AlgebraicSum", "aggregation: NormalizedSum", "line 20", "NormalizedSum"),
        ("aggregation: AlgebraicSum", "aggregation: none", "line 16", "needs an aggregation"),
        ("Engine: heater", "Motor: heater", "line 1, column 1", "'Motor'"),
        ("Engine: heater: the", "heater the", "line 1, column 1", "key: value"),
        ("activation: General", "activation: First 1 0", "line 30, column 15", "First"),
        ("implication: Minimum", "implication: none", "line 26", "need an implication"),
        ("conjunction: AlgebraicProduct", "conjunction: none", "line 26", "need a conjunction"),
        ("conjunction: none", "conjunction: Minimum", "line 33, column 3", "different conjunction"),
        ("is cold and", "is colder and", "line 31, column 9", "'cold'"),
        ("is cold and", "is and", "line 31, column 20", "a set of 'room'"),
        ("if room", "if roam", "line 31, column 9", "'room'"),
        ("then power is high", "then room is cold", "line 31, column 9", "no output 'room'"),
        ("power is high", "power is not high", "line 31, column 9", "strength"),
        ("with 0.5", "with 1.5", "line 31", "weight"),
    ],
)
def test_read_errors(old, new, position, message):
    assert old in HEATER
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fll(HEATER.replace(old, new, 1))
    assert position in str(error.value)
    assert message in str(error.value)


def test_position_in_a_long_line():
    """Reading takes a time that grows linearly: 60,000 words took 13 s."""
    words = " ".join(["cold"] * 60_000)
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fll(HEATER.replace("cold ZShape 5 18", f"cold ZShape 5 18 {words} x", 1))
    assert "line 7, column" in str(error.value)
    assert len(str(error.value)) < 300


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("aggregation: none", "aggregation: Maximum", "rules with one consequent (line 21)"),
        ("range: 0 10", "range: 0 10\nlock-range: true", "may leave its range"),
        ("TakagiSugeno", "Tsukamoto", "expected TakagiSugeno"),
        ("Linear 1 2 3", "Linear 1", "2 coefficients"),
        ("Constant 7", "Constant inf", "finite"),
        ("Constant 7", "Triangle 0 1 2", "mixes"),
    ],
)
def test_sugeno_read_errors(old, new, message):
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fll(MIXER.replace(old, new, 1))
    assert message in str(error.value)


def test_aggregation_without_repeated_consequents():
    text = MIXER.replace("aggregation: none", "aggregation: Maximum")
    assert read_fll(text.replace("rule: if b is on then y is flat\n", "")).outputs[0].is_sugeno


@pytest.mark.parametrize("text", ["", "\n#\n", "x", ":", "Engine:", "RuleBlock:", "\0"])
def test_texts_without_components(text):
    with pytest.raises(InvalidFuzzyFile):
        read_fll(text)


def test_write_errors():
    system = read_fll(HEATER)
    for change, message in (
        ({"name": "a # b"}, "a # b"),
        ({"inputs": (replace(system.inputs[0], name="two words"), system.inputs[1])}, "two words"),
        ({"outputs": (replace(system.outputs[0], defuzzifier="som"),)}, "som"),
    ):
        if "inputs" in change:
            change["rules"] = (replace(system.rules[1], antecedent=Is("sky", "dark")),)
        with pytest.raises(InvalidInput, match=message):
            write_fll(replace(system, **change))
    rule = replace(system.rules[0], consequents=(Is("power", "low", ("not",)),))
    with pytest.raises(InvalidInput, match="complement"):
        write_fll(replace(system, rules=(rule,)))
    with pytest.raises(InvalidInput, match="type 2"):
        write_fll(system.with_footprint(Footprint(0.5)))


def test_vertical_edges_round_trip():
    system = read_fll(HEATER)
    shapes = ("linsmf", "linzmf", "smf", "zmf")
    steps = tuple(
        replace(each, upper=Membership(shape, (3, 3)))
        for each, shape in zip(system.inputs[0].sets, shapes, strict=True)
    )
    system = replace(system, inputs=(replace(system.inputs[0], sets=steps), system.inputs[1]))
    text = write_fll(system)
    assert f"Binary 3.0 {inf}" in text
    assert read_fll(text) == system


def test_all_shapes_round_trip():
    for shape, kind in SHAPES.items():
        system = read_fll(OLD)
        parameters = tuple(range(1, 1 + len(kind.parameters))) or (1, 0, 2, 1)
        function = Membership(shape, parameters)
        sets = (replace(system.inputs[0].sets[0], upper=function),)
        system = replace(system, inputs=(replace(system.inputs[0], sets=sets),))
        assert read_fll(write_fll(system)) == system


PIECES = [
    *("nan", "inf", "-inf", "1e999", "0 0", "none", "any", "not", ":", "#", "\n", "\0", "'", "("),
    *("rule: if a is any then y is up\n", "term: t Discrete\n", "Engine: x\n", "range: 0 0\n"),
]


@examples(120)
@given(mutated([HEATER, MIXER, OLD], PIECES) | st.text())
def test_mutated_text_is_read_or_refused(text):
    try:
        system = read_fll(text)
        again = write_fll(system)
    except InvalidInput:
        return
    assert read_fll(again) == as_read(system)


def test_deep_parentheses():
    deep = "(" * 3000 + "a is on" + ")" * 3000
    with pytest.raises(InvalidFuzzyFile, match="nested"):
        read_fll(OLD.replace("if a is on", f"if {deep}"))


def test_limits(monkeypatch):
    with pytest.raises(InvalidFuzzyFile, match="more than 1000 terms"):
        read_fll(OLD.replace("  term: on", "  term: on Triangle 0 1 2\n" * 1000 + "  term: on"))
    with pytest.raises(InvalidFuzzyFile, match="more than 64"):
        read_fll("InputVariable: a\n" * 65 + OLD)
    monkeypatch.setattr("omnidrive.fuzzy.files.fll.semantics.MAX_RULES", 10)
    with pytest.raises(InvalidFuzzyFile, match="more than 10 rules"):
        read_fll(OLD + "  rule: if a is on then y is up\n" * 10)
