"""The fuzzy control language as IEC 61131-7 and the examples of jFuzzyLogic write it."""

import math
import re

import numpy as np
import pytest

from omnidrive.cli.main import load_verb
from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy import Inference, UnreadBlockWarning, load
from omnidrive.fuzzy.files.fcl import read_fcl, write_fcl
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rules import And, Is, Or
from omnidrive.fuzzy.variables import LinearFunction
from tests.shared_data import shared

LINEAR = """\
FUNCTION_BLOCK fn
VAR_INPUT
  x : REAL;
  y : REAL; // is not fuzzified
END_VAR
VAR_OUTPUT
  u : REAL;
END_VAR
FUZZIFY x
  TERM lo := (0,1)(10,0);
  TERM hi := (0,0)(10,1);
END_FUZZIFY
DEFUZZIFY u
  TERM f := FUNCTION (2*x + 1);
  TERM g := FUNCTION (5 - x);
  METHOD : COGS;
  DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK
  RULE 1: IF x IS lo THEN u IS f;
  RULE 2: IF x IS hi THEN u IS g;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""

GROUPS = """\
FUNCTION_BLOCK nt
VAR_INPUT a : REAL; b : REAL; c : REAL; END_VAR
VAR_OUTPUT u : REAL; END_VAR
FUZZIFY a TERM hot := (0,0)(10,1); END_FUZZIFY
FUZZIFY b TERM wet := (0,0)(10,1); END_FUZZIFY
FUZZIFY c TERM far := (0,0)(10,1); END_FUZZIFY
DEFUZZIFY u
  TERM off := 0;
  TERM on := 1;
  METHOD : COGS;
  DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK r
  AND : MIN;
  RULE 1: IF CONDITION THEN u IS on;
  RULE 2: IF a IS hot OR NOT a IS hot THEN u IS off WITH 1.0;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


def function(text):
    return read_fcl(LINEAR.replace("FUNCTION (2*x + 1)", f"FUNCTION {text}")).outputs[0].sets[0]


def test_linear_functions():
    system = read_fcl(LINEAR)
    assert Inference(system)(4.0, 1e6)[0] == pytest.approx(0.6 * 9 + 0.4 * 1)
    assert read_fcl(write_fcl(system)) == system
    path = shared("cases/09-fcl-function-and-not-group/linear.fcl")
    assert Inference(read_fcl(path.read_text(encoding="utf-8")))(4.0)[0] == pytest.approx(5.8)


@pytest.mark.parametrize(
    ("text", "constant", "coefficients"),
    [
        ("(x * 2.0) + 1", 1, (2, 0)),
        ("x -1", -1, (1, 0)),
        ("2*x-1", -1, (2, 0)),
        ("-x + -2*y", 0, (-1, -2)),
        ("-(x + 1)*2/4 - y", -0.5, (-0.5, -1)),
        ("2^3*x + y*0", 0, (8, 0)),
        ("x + 7 % 4", 3, (1, 0)),
        ("3*(x - 2*(y + 1)) - (x - y)", -6, (2, -5)),
        ("x*LN(EXP(2)) + SIN(0) + COS(0) + ABS(0 - 3) + LOG(100)", 6, (2, 0)),
        ("x - x", 0, (0, 0)),
    ],
)
def test_expressions(text, constant, coefficients):
    found = function(text)
    assert found.constant == pytest.approx(constant, abs=1e-12)
    assert found.coefficients == pytest.approx(coefficients, abs=1e-12)


def test_constants_and_variables_as_terms():
    assert function("(2 + 3) * 4") == LinearFunction("f", 20.0)
    text = LINEAR.replace("FUNCTION (2*x + 1)", "y").replace("COGS", "COGF")
    assert read_fcl(text).outputs[0].sets[0] == LinearFunction("f", 0.0, (0.0, 1.0))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("(x * x)", "'\\*' makes this function nonlinear; only linear functions of the inputs"),
        ("1 / x", "'/' makes this function nonlinear"),
        ("x ^ 2", "'\\^' makes this function nonlinear"),
        ("x % 2", "'%' makes this function nonlinear"),
        ("(x * 3.0) + 5 * SIN(x)", "line 14, column 38: .*'SIN' makes this function nonlinear"),
        ("x / 0", "division by 0"),
        ("x / (1 - 1)", "division by 0"),
        ("LN(0)", "'LN' has no finite value"),
        ("(0 - 8) ^ 0.5", "has no finite value"),
        ("10 ^ 999", "has no finite value"),
        ("1e99 * 1e99 * x", "is not a finite number"),
        ("z + 1", "there is no input 'z'"),
        ("u", "there is no input 'u'"),
        ("(x", "expected \\), got ';'"),
        ("", "expected the name of an input, a number or '\\('"),
        ("(" * 1000 + "x", "nested more than 50 deep"),
        ("- " * 1000 + "x", "nested more than 50 deep"),
        (" + ".join(f"v{k}" for k in range(100)), "at most 64 variables"),
    ],
)
def test_functions_that_are_refused(text, says):
    with pytest.raises(InvalidFuzzyFile, match=says):
        function(text)


def test_not_before_groups():
    folder = "cases/09-fcl-function-and-not-group"
    texts = [
        shared(f"{folder}/{name}.fcl").read_text(encoding="utf-8")
        for name in ("not_group", "not_group_expanded")
    ]
    assert read_fcl(texts[0]) == read_fcl(texts[1])


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (
            "NOT (a IS hot AND b IS wet)",
            Or((Is("a", "hot", ("not",)), Is("b", "wet", ("not",)))),
        ),
        (
            "NOT (NOT a IS hot OR (b IS NOT wet AND c IS far))",
            And((Is("a", "hot"), Or((Is("b", "wet"), Is("c", "far", ("not",)))))),
        ),
        ("NOT (NOT (a IS hot OR b IS wet))", Or((Is("a", "hot"), Is("b", "wet")))),
        ("NOT NOT (a IS hot AND b IS wet)", And((Is("a", "hot"), Is("b", "wet")))),
        (
            "c IS far AND NOT(a IS hot OR b IS wet)",
            And((Is("c", "far"), Is("a", "hot", ("not",)), Is("b", "wet", ("not",)))),
        ),
        (
            "not (a is very hot or b is not wet)",
            And((Is("a", "hot", ("not", "very")), Is("b", "wet"))),
        ),
    ],
)
def test_negated_groups(condition, expected):
    assert read_fcl(GROUPS.replace("CONDITION", condition)).rules[0].antecedent == expected


def test_negated_groups_need_dual_operators():
    text = GROUPS.replace("CONDITION", "NOT (a IS hot OR b IS wet)")
    for conjunction, disjunction in (
        ("PROD", "probor"),
        ("BDIF", "bsum"),
        ("DMIN", "drastic"),
        ("NIPMIN", "nilpotent"),
    ):
        system = read_fcl(text.replace("AND : MIN", f"AND : {conjunction}"))
        assert system.disjunction == disjunction
    with pytest.raises(InvalidFuzzyFile, match="line 15, column 18: NOT before a group needs an"):
        read_fcl(text.replace("AND : MIN", "AND : HAMACHER"))
    with pytest.raises(InvalidFuzzyFile, match="nested more than"):
        read_fcl(GROUPS.replace("CONDITION", "NOT (" * 100 + "a IS hot" + ")" * 100))


def test_singletons_of_inputs():
    text = LINEAR.replace("(0,1)(10,0)", "3").replace("(0,0)(10,1)", "TRIAN 5 5 5")
    system = read_fcl(text)
    assert [each.upper for each in system.inputs[0].sets] == [
        Membership("trimf", (3, 3, 3)),
        Membership("trimf", (5, 5, 5)),
    ]
    assert (system.inputs[0].low, system.inputs[0].high) == (3.0, 5.0)
    assert read_fcl(write_fcl(system)) == system
    several = read_fcl(LINEAR.replace("(0,1)(10,0)", "SINGLETONS (3, 0.5) (1, 1)"))
    degrees = several.inputs[0].sets[0].upper(np.array([0.9, 1, 2, 3, 4]))
    assert degrees.tolist() == [0, 1, 0, 0.5, 0]
    with pytest.raises(InvalidFuzzyFile, match="a point appears twice"):
        read_fcl(LINEAR.replace("(0,1)(10,0)", "SINGLETONS (3, 0.5) (3, 1)"))


def test_cosine():
    found = read_fcl(LINEAR.replace("(0,1)(10,0)", "COSINE 5 4")).inputs[0].sets[0].upper
    assert found == Membership("cosinemf", (5, 4))
    assert found(5.0) == pytest.approx((math.cos(math.pi / 5) + 1) / 2)
    system = read_fcl(LINEAR.replace("(0,1)(10,0)", "COSINE 5 4"))
    assert (system.inputs[0].low, system.inputs[0].high) == (-1.0, 10.0)
    assert read_fcl(write_fcl(system)) == system


def test_several_blocks():
    other = LINEAR.replace("BLOCK fn", "BLOCK other")
    with pytest.warns(
        UnreadBlockWarning, match="only the first FUNCTION_BLOCK, 'fn', is read, not"
    ):
        assert read_fcl(LINEAR + other) == read_fcl(LINEAR)
    assert read_fcl(LINEAR + other, "other").name == "other"
    there = "no FUNCTION_BLOCK 'third'; there are 'fn', 'other'"
    with pytest.raises(InvalidFuzzyFile, match=there):
        read_fcl(LINEAR + other, "third")
    with pytest.raises(InvalidFuzzyFile, match="expected END_FUNCTION_BLOCK"):
        read_fcl(LINEAR + other.replace("END_FUNCTION_BLOCK", ""))


def test_block_of_a_file(tmp_path, capsys, recwarn):
    file = tmp_path / "two.fcl"
    file.write_text(LINEAR + LINEAR.replace("BLOCK fn", "BLOCK other"))
    assert load(file, "other").name == "other"
    assert not [each for each in recwarn if each.category is UnreadBlockWarning]
    with pytest.warns(UnreadBlockWarning, match=r"two\.fcl: only the first .* 'fn'.* not 'other'"):
        load(file)
    load_verb("fuzzy")(["show", str(file)], standalone_mode=False)
    out, err = capsys.readouterr()
    assert "fn" in out
    assert len(re.findall("two.fcl: only the first FUNCTION_BLOCK", " ".join(err.split()))) == 1
    load_verb("fuzzy")(["show", str(file), "--block", "other"], standalone_mode=False)
    out, err = capsys.readouterr()
    assert "other" in out
    assert "FUNCTION_BLOCK" not in err
    (tmp_path / "one.fis").write_text("")
    with pytest.raises(InvalidInput, match=r"only \.fcl files have blocks"):
        load(tmp_path / "one.fis", "other")


def test_variables_in_points():
    for old, new in (("(10,0)", "(y, 0)"), ("(0,1)(10,0)", "TRIAN 0 y 10")):
        with pytest.raises(InvalidFuzzyFile, match="the variable 'y' in a set is not supported"):
            read_fcl(LINEAR.replace(old, new, 1))


def test_accumulation_of_singletons():
    """Two rules conclude ``on``; jFuzzyLogic aggregates their strengths before the mean."""
    text = GROUPS.replace("CONDITION", "a IS hot").replace(
        "  RULE 2", "  RULE 3: IF b IS wet THEN u IS on;\n  RULE 2"
    )
    for accu, method in (("MAX", "max"), ("PROBOR", "probor"), ("BSUM", "bsum")):
        output = read_fcl(text.replace("AND : MIN;", f"AND : MIN; ACCU : {accu};")).outputs[0]
        assert (output.aggregation, output.defuzzifier) == (method, "centroid")
        assert [each.upper.parameters for each in output.sets] == [(0, 0, 0), (1, 1, 1)]
    assert read_fcl(text.replace("AND : MIN;", "AND : MIN; ACCU : SUM;")).is_sugeno


def test_singletons_beside_sets():
    sets = "DEFUZZIFY v\n TERM low := TRIAN 0 1 2;\n METHOD : COG;\nEND_DEFUZZIFY\nRULEBLOCK"
    text = GROUPS.replace("CONDITION", "a IS hot").replace("u : REAL;", "u : REAL; v : REAL;")
    text = text.replace("RULEBLOCK", sets, 1).replace("AND : MIN;", "AND : MIN; ACCU : MAX;")
    system = read_fcl(text.replace("u IS on", "u IS on, v IS low"))
    assert [each.is_sugeno for each in system.outputs] == [False, False]
    assert system.outputs[0].default == 0.0
