from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files.fcl import read_fcl, write_fcl
from omnidrive.fuzzy.files.fcl.lexer import RESERVED
from omnidrive.fuzzy.files.fcl.term_semantics import simplest_shape
from omnidrive.fuzzy.files.fll.writer import FUNCTIONS
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rules import And, Is, Or
from omnidrive.fuzzy.variables import Footprint, FuzzySet, LinearFunction
from tests.examples import examples
from tests.fuzzy.mutations import mutated
from tests.fuzzy.systems import IDENTIFIERS, systems
from tests.fuzzy.test_fcl_dialect import GROUPS, LINEAR

IEC = """\
(* a heater,
   in jFuzzyLogic's dialect *)
FUNCTION_BLOCK heater // comments
VAR_INPUT
    room : REAL; /* in degrees */
    RANGE := (-10 .. 40);
    sky : real;
END_VAR
VAR_OUTPUT
    power : REAL;
END_VAR
FUZZIFY room
    TERM cold := (5, 1) (18, 0) ;
    TERM warm := (15,0) (22,1) (27,0);
    TERM mild := trian 10 15 20;
    TERM hot := (24, 0) (30, 1);
    TERM best := GBELL 2 3 21;
    TERM fine := GAUSS 21 3;
END_FUZZIFY
FUZZIFY sky
    TERM dark := (0, 1) (0.2, 1) (0.4, 0);
    TERM odd := (0, 0) (0.5, 0.7) (1, 0);
END_FUZZIFY
DEFUZZIFY power
    RANGE := (0 .. 100);
    TERM low := TRAPE 0 0 10 30;
    TERM high := SIGM 0.5 70;
    METHOD : MM;
    DEFAULT := 7;
END_DEFUZZIFY
RULEBLOCK No1
    ACCU : MAX;
    AND : PROD;
    ACT : PROD;
    RULE 1 : IF room IS cold AND sky IS NOT dark OR room IS hot THEN power IS high;
    RULE two : IF NOT room IS warm AND (sky IS odd OR
        NOT (room IS mild)) THEN power IS low WITH 0.5;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""

FUZZYLITE = """\
FUNCTION_BLOCK heater, the small one
% a comment
VAR_INPUT
  room: REAL;
END_VAR
VAR_OUTPUT
  power: REAL;
END_VAR
FUZZIFY room
  ENABLED : TRUE;
  RANGE := (-10.000 .. 40.000);
  TERM cold := ZShape 5.000 18.000;
  TERM any := Bell 22 4 3;
  TERM hot := (24, 0) (30, 1)
END_FUZZIFY
DEFUZZIFY power
  RANGE := (0.000 .. 1.000);
  TERM low := 0.25;
  TERM high := Linear 1.5 0.5;
  METHOD : COGSS;
  LOCK : PREVIOUS;
  DEFAULT := nan;
END_DEFUZZIFY
RULEBLOCK
  AND : EPROD;
  OR : HSUM;
  ACT : MIN;
  RULE 1 : if room is cold or room is hot and room is not very any then power is high
  RULE 2 : if room is seldom hot then power is low with 0.25
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
FUZZYLITE = FUZZYLITE.replace("  LOCK : PREVIOUS;\n", "")

PROD = ("prod", "probor", "prod")

SINGLETONS = """\
FUNCTION_BLOCK
VAR_INPUT a : REAL; END_VAR
VAR_OUTPUT y : REAL; END_VAR
FUZZIFY a TERM on := (0, 0) (1, 1); TERM off := (0, 1) (1, 0); END_FUZZIFY
DEFUZZIFY y TERM up := 5; TERM down := -5; METHOD : COGS; END_DEFUZZIFY
RULEBLOCK b
AND : MIN;
RULE 1 : IF a IS on THEN y IS up;
RULE 2 : IF a IS off THEN y IS down;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


def test_read_iec_dialect():
    system = read_fcl(IEC)
    room, sky = system.inputs
    assert system.name == "heater"
    assert (room.low, room.high, sky.low, sky.high) == (-10.0, 40.0, 0.0, 1.0)
    assert [each.upper for each in (*room.sets, *sky.sets)] == [
        Membership("linzmf", (5, 18)),
        Membership("trimf", (15, 22, 27)),
        Membership("trimf", (10, 15, 20)),
        Membership("linsmf", (24, 30)),
        Membership("gbellmf", (2, 3, 21)),
        Membership("gaussmf", (3, 21)),
        Membership("linzmf", (0.2, 0.4)),
        Membership("pointsmf", (0, 0, 0.5, 0.7, 1, 0)),
    ]
    (power,) = system.outputs
    assert (power.aggregation, power.defuzzifier, power.default) == ("max", "mom", 7.0)
    assert (system.conjunction, system.disjunction, system.implication) == (
        "prod",
        "probor",
        "prod",
    )
    first, second = system.rules
    cold, dark = Is("room", "cold"), Is("sky", "dark", ("not",))
    assert first.antecedent == Or((And((cold, dark)), Is("room", "hot")))
    inner = Or((Is("sky", "odd"), Is("room", "mild", ("not",))))
    assert second.antecedent == And((Is("room", "warm", ("not",)), inner))
    assert second.weight == 0.5
    assert read_fcl(write_fcl(system)) == system


def test_read_fuzzylite_dialect():
    system = read_fcl(FUZZYLITE)
    assert system.name == "heater, the small one"
    assert [each.upper.shape for each in system.inputs[0].sets] == ["zmf", "gbellmf", "linsmf"]
    assert system.outputs[0].sets == (
        LinearFunction("low", 0.25),
        LinearFunction("high", 0.5, (1.5,)),
    )
    assert system.outputs[0].defuzzifier == "wtsum"
    assert (system.conjunction, system.disjunction) == ("einstein", "hamacher")
    tight = And((Is("room", "hot"), Is("room", "any", ("not", "very"))))
    assert system.rules[0].antecedent == Or((Is("room", "cold"), tight))
    renamed = read_fcl(FUZZYLITE.replace("any", "best"))
    assert read_fcl(write_fcl(renamed, "fuzzylite")) == renamed


def test_singletons_and_default_range():
    system = read_fcl(SINGLETONS)
    assert (system.inputs[0].low, system.inputs[0].high) == (0.0, 1.0)
    assert (system.outputs[0].low, system.outputs[0].high) == (-5.0, 5.0)
    assert system.is_sugeno
    assert read_fcl(write_fcl(system)) == system


def test_single_operator_selects_its_partner():
    for given_, expected in (
        ("OR : BSUM", ("lukasiewicz", "bsum")),
        ("AND : DMIN", ("drastic",) * 2),
    ):
        system = read_fcl(SINGLETONS.replace("AND : MIN", given_))
        assert (system.conjunction, system.disjunction) == expected


def test_unpaired_operators():
    text = SINGLETONS.replace("IF a IS on THEN", "IF a IS on AND a IS off THEN")
    system = read_fcl(text.replace("AND : MIN;", "OR : ASUM; AND : MIN;"))
    assert (system.conjunction, system.disjunction) == ("min", "probor")
    assert read_fcl(write_fcl(system)) == system
    with pytest.raises(InvalidFuzzyFile, match="replaces this AND by the partner"):
        read_fcl(text.replace("AND : MIN;", "AND : MIN; OR : ASUM;"))


def test_simplest_shape_ignores_redundant_points():
    assert simplest_shape(Membership("pointsmf", (0, 1, 2, 1, 3, 0, 4, 0))) == Membership(
        "linzmf", (2, 3)
    )
    points = FUZZYLITE.replace("ZShape 5.000 18.000", "Discrete 0 0 1 1 2 0")
    assert read_fcl(points).inputs[0].sets[0].upper.shape == "pointsmf"
    flat = Membership("pointsmf", (0, 1, 2, 1))
    assert simplest_shape(flat) is flat


def as_iec_reads(system):
    """Return the system as it is read: points as shapes, ineffective aggregations as max."""

    def simplified(each):
        return (
            replace(each, upper=simplest_shape(each.upper)) if isinstance(each, FuzzySet) else each
        )

    return replace(
        system,
        inputs=tuple(replace(v, sets=tuple(map(simplified, v.sets))) for v in system.inputs),
        outputs=tuple(
            replace(
                v,
                sets=tuple(map(simplified, v.sets)),
                aggregation="max" if v.is_sugeno and v.aggregation != "sum" else v.aggregation,
            )
            for v in system.outputs
        ),
    )


IEC_SHAPES = tuple(
    "trimf trapmf linsmf linzmf gaussmf gauss2mf gbellmf sigmf pointsmf".split()  # noqa: SIM905
)
NAMES = IDENTIFIERS.filter(lambda name: name.lower() not in RESERVED | FUNCTIONS)
PAIRS = [("min", "max"), ("prod", "probor"), ("lukasiewicz", "bsum"), ("hamacher", "einstein")]


@examples(40)
@given(
    systems(
        types=(1,),
        names=NAMES,
        shapes=IEC_SHAPES,
        aggregations=("max", "bsum", "probor", "sum"),
        defuzzifiers=("centroid", "bisector", "mom", "lm", "rm", "wtaver"),
        outputs_alike=True,
        hedges=("not",),
        negated_consequents=False,
    ),
    st.sampled_from(PAIRS),
)
def test_iec_round_trip(system, pair):
    system = replace(system, conjunction=pair[0], disjunction=pair[1])
    assert read_fcl(write_fcl(system)) == as_iec_reads(system)


@examples(40)
@given(
    systems(
        types=(1,),
        names=NAMES,
        negated_consequents=False,
        defuzzifiers=("centroid", "bisector", "mom", "lm", "rm", "wtaver", "wtsum"),
    )
)
def test_fuzzylite_round_trip(system):
    assert read_fcl(write_fcl(system, "fuzzylite")) == as_fuzzylite_reads(system)


def as_fuzzylite_reads(system):
    return replace(system, outputs=as_iec_reads(system).outputs) if system.is_sugeno else system


@pytest.mark.parametrize(
    ("old", "new", "position", "message"),
    [
        ("power IS low WITH 0.5;\nEND_RULEBLOCK", "(* x", "line 37, column 34", "not closed"),
        ("FUNCTION_BLOCK heater", "BLOCK heater", "line 3, column 1", "FUNCTION_BLOCK"),
        ("room : REAL;", "room : BOOL;", "line 5, column 12", "REAL"),
        ("sky : real;", "room : real;", "line 7, column 5", "'room' appears twice"),
        ("(-10 .. 40)", "(40 .. 40)", "line 5", "must have a width"),
        ("(-10 .. 40)", "(-10, 40)", "line 6, column 18", "expected .."),
        ("(-10 .. 40)", "(-10 .. 1e999)", "line 6, column 22", "expected a number, got"),
        ("FUZZIFY sky", "FUZZIFY sun", "line 20, column 9", "'sun'"),
        ("FUZZIFY sky", "FUZZIFY room", "line 20, column 9", "second FUZZIFY"),
        ("(5, 1) (18, 0)", "(18, 1) (5, 0)", "line 13, column 18", "ascend"),
        ("(5, 1) (18, 0)", "(5, 2) (18, 0)", "line 13, column 18", "[0, 1]"),
        ("(5, 1) (18, 0)", "(5, x)", "line 13, column 22", "number"),
        ("(5, 1) (18, 0)", "COSINE 1", "line 13, column 18", "expected 2 numbers, got 1"),
        ("(5, 1) (18, 0)", "FUNCTION x^2", "line 13, column 28", "nonlinear"),
        ("(5, 1) (18, 0)", "FUNCTION 2", "line 13, column 10", "must be fuzzy sets"),
        ("(5, 1) (18, 0)", "DSIGM 3 1 2 1", "line 13, column 18", "becomes negative"),
        ("TERM warm", "TERM cold", "line 5", "'cold' is there twice"),
        ("GBELL 2 3 21", "GBELL 2 3", "line 17, column 18", "expected 3 numbers"),
        ("METHOD : MM", "METHOD : COGF", "line 10", "fuzzy sets"),
        ("METHOD : MM", "METHOD : COGS", "line 10", "fuzzy sets"),
        ("    METHOD : MM;\n", "", "line 10", "METHOD"),
        ("DEFAULT := 7", "DEFAULT := NC", "line 29, column 16", "NC"),
        ("DEFAULT := 7", "DEFAULT := 7 | NC", "line 29, column 18", "NC"),
        ("    ACCU : MAX;\n", "", "line 10", "SUM in jFuzzyLogic"),
        ("ACCU : MAX", "ACCU : NSUM", "line 32, column 12", "NSUM"),
        ("AND : PROD", "AND : PROD; AND : MIN", "line 33, column 17", "twice"),
        (
            "AND : PROD",
            "OR : MAX; AND : PROD",
            "line 33, column 10",
            "replaces this OR by the partner",
        ),
        ("AND sky IS NOT dark OR", "OR sky IS NOT dark AND", "line 35, column 49", "parentheses"),
        ("room IS cold", "room IS very cold", "", ""),
        ("room IS cold", "room IS colder", "line 35, column 14", "'cold'"),
        ("room IS cold", "roam IS cold", "line 35, column 14", "'room'"),
        ("power IS high", "power IS NOT high", "line 35, column 14", "consequent"),
        ("WITH 0.5", "WITH 1.5", "line 37", "[0, 1]"),
        ("END_FUNCTION_BLOCK", "END_FUNCTION_BLOCK FUNCTION_BLOCK b", "line 40", "got the end"),
        ("RULEBLOCK No1", "RULEBLOCK No1 ENABLED : FALSE;", "line 31", "not enabled"),
    ],
)
def test_read_errors(old, new, position, message):
    assert old in IEC
    text = IEC.replace(old, new, 1)
    if not message:
        assert read_fcl(text)
        return
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fcl(text)
    assert position in str(error.value)
    assert message in str(error.value)


def test_repeated_singletons():
    text = SINGLETONS.replace("y IS down;", "y IS up;")
    assert read_fcl(text.replace("AND : MIN;", "ACCU : SUM;")).outputs[0].aggregation == "sum"
    for accu, name in (("MAX", "max"), ("PROBOR", "probor"), ("BSUM", "bsum")):
        output = read_fcl(text.replace("AND : MIN;", f"ACCU : {accu};")).outputs[0]
        assert (output.aggregation, output.defuzzifier) == (name, "centroid")
        assert not output.is_sugeno


def test_several_rule_blocks():
    block = SINGLETONS[SINGLETONS.index("RULEBLOCK") : SINGLETONS.index("END_FUNCTION")]
    first, second = block.replace("RULE 2 ", "x").split("x")[0] + "END_RULEBLOCK\n", block
    with pytest.raises(InvalidFuzzyFile, match="second RULEBLOCK has rules for 'y'"):
        read_fcl(SINGLETONS.replace(block, first + second))
    fuzzylite = SINGLETONS.replace("METHOD", "LOCK : RANGE; METHOD").replace(block, first + second)
    assert len(read_fcl(fuzzylite).rules) == 3
    with pytest.raises(InvalidFuzzyFile, match="different AND"):
        read_fcl(fuzzylite.replace("AND : MIN", "AND : PROD", 1))


def test_write_errors():
    system = read_fcl(FUZZYLITE.replace("any", "best"))
    with pytest.raises(InvalidInput, match=r"'heater, the small one'"):
        write_fcl(system)
    system = replace(system, name="")
    with pytest.raises(InvalidInput, match=r"zmf.*write_fcl\(system, 'fuzzylite'\)"):
        write_fcl(system)
    iec = read_fcl(IEC)
    with pytest.raises(InvalidInput, match="type 2"):
        write_fcl(iec.with_footprint(Footprint(0.5)))
    with pytest.raises(InvalidInput, match="'max'"):
        write_fcl(replace(iec, disjunction="max"))
    with pytest.raises(InvalidInput, match="'som'"):
        write_fcl(replace(iec, outputs=(replace(iec.outputs[0], defuzzifier="som"),)))
    with pytest.raises(InvalidInput, match="keyword"):
        write_fcl(replace(iec, name="Rule"))
    with pytest.raises(InvalidInput, match="one line"):
        write_fcl(replace(iec, name="a // b"), "fuzzylite")


PIECES = [
    *("nan", "inf", "-", "1e999", "(", ")", ";", ":=", "..", "(*", "*)", "//", "#", "\n", "\0"),
    *("FUNCTION ", "SINGLETONS ", "COSINE 1 2", "NOT (", "^", "*", "/ 0", "LN("),
    *("AND", "OR", "NOT", "any", "very", "ACCU : MAX;", "RANGE := (0 .. 0);", "END_RULEBLOCK"),
]


@pytest.mark.filterwarnings("ignore:only the first FUNCTION_BLOCK")
@examples(120)
@given(mutated([IEC, FUZZYLITE, SINGLETONS, LINEAR, GROUPS], PIECES) | st.text())
def test_mutated_text_is_read_or_refused(text):
    try:
        system = read_fcl(text)
    except InvalidInput:
        return
    for dialect in ("iec", "fuzzylite"):
        try:
            again = write_fcl(system, dialect)
        except InvalidInput:
            continue
        assert read_fcl(again) == (
            as_iec_reads(system) if dialect == "iec" else as_fuzzylite_reads(system)
        )


def test_deep_parentheses():
    for opening in ("(", "NOT (", "NOT "):
        deep = opening * 100_000 + "a IS on"
        with pytest.raises(InvalidFuzzyFile):
            read_fcl(SINGLETONS.replace("IF a IS on", f"IF {deep}"))


def test_unclosed_comments():
    with pytest.raises(InvalidFuzzyFile, match="is not closed"):
        read_fcl("FUNCTION_BLOCK a\n" + "(*" * 500_000)
