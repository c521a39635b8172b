"""Matlab's .fis files: layouts of real files, lossless round trips and malformed text."""

import os
import re
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from omnidrive.errors import CannotWrite, InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files import GapWarning, SigmaWarning, load, save
from omnidrive.fuzzy.files.fis import read_fis, write_fis
from omnidrive.fuzzy.membership import MATLAB_SHAPES, Membership
from omnidrive.fuzzy.rules import And, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Secondary,
)
from tests.examples import examples
from tests.fuzzy.systems import PRINTABLE_NAMES, systems
from tests.memory import allocates_at_most
from tests.shared_data import shared

MATLAB_SYSTEMS = {
    "types": (1, 2),
    "shapes": MATLAB_SHAPES,
    "free_lower": False,
    "conjunctions": ("min", "prod"),
    "disjunctions": ("max", "probor"),
    "aggregations": ("max", "sum", "probor"),
    "defuzzifiers": ("centroid", "bisector", "mom", "som", "lom", "wtaver", "wtsum"),
    "algorithms": ("km", "ekm", "iasc", "eiasc"),
    "outputs_alike": True,
    "defaults": False,
    "hedges": ("not",),
    "nesting": 0,
}

HEATER = """\
% a heater, as old Matlab and Octave write it
## with comments of both
[System]
Name = 'heater %1'   % not a comment within quotes
Type='mamdani'
NumInputs=2
NumOutputs=2
NumRules=4
AndMethod='min'
OrMethod='probor'
ImpMethod='prod'
AggMethod='sum'
DefuzzMethod='centroid'

[Input1]
Name='room'
Range=[0 40]
NumMFs=2
  MF1 = 'cold, dark'   : 'trapmf', [-1  0 10 20]
  MF2='it''s hot':'gbellmf',[10 2 40 0]

[Input2]
Name='wall'
Range=[ -1.5e1, 30.000 ]
NumMFs=2
MF2='hot':'smf',[5 25]
MF1='cold':'zmf',[5 25]

[Output1]
Name='power'
Range=[0 1]
NumMFs=2
MF1='low':'trimf',[-1 0 1]
MF2='high':'trimf',[0 1 2]

[Output2]
Name='fan'
Range=[0 1]
NumMFs=1
MF1='on':'gaussmf',[0.2 1]

[Rules]
1 1, 2 1 (1) : 1
2.000 0.000 , 1.000 0 (0.5) : 2
-1 -2, -1 1 (1) : 2
-1.2 2.05, 2 0 (0.25) : 1
"""


def error_of(text):
    """Return the message of the error that reading a text raises."""
    with pytest.raises(InvalidFuzzyFile) as caught:
        read_fis(text)
    return str(caught.value)


def test_layouts_and_comments_of_real_files():
    system = read_fis(HEATER.replace("\n", "\r\n"))
    room, wall = system.inputs
    power, fan = system.outputs
    assert system.name == "heater %1"
    assert [s.name for s in room.sets] == ["cold, dark", "it's hot"]
    assert room.sets[1].upper == Membership("gbellmf", (10.0, 2.0, 40.0))
    assert [s.name for s in wall.sets] == ["cold", "hot"]
    assert (wall.low, wall.high) == (-15.0, 30.0)
    assert (system.conjunction, system.disjunction, system.implication) == ("min", "probor", "prod")
    assert (power.aggregation, fan.defuzzifier, fan.default) == ("sum", "centroid", None)
    low, high, on = Is("power", "low"), Is("power", "high"), Is("fan", "on")
    assert system.rules == (
        Rule(And((Is("room", "cold, dark"), Is("wall", "cold"))), (high, on)),
        Rule(Is("room", "it's hot"), (low,), 0.5),
        Rule(
            Or((Is("room", "cold, dark", ("not",)), Is("wall", "hot", ("not",)))),
            (replace(low, hedges=("not",)), on),
        ),
        Rule(
            And((Is("room", "cold, dark", ("not", "very")), Is("wall", "hot", ("somewhat",)))),
            (high,),
            0.25,
        ),
    )


TYPE_2 = """\
[System]
Name='t2'
Type='{type}'
Version=3.0
NumInputs=1
NumOutputs=1
NumRules=1
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='{defuzzifier}'
{reduction}

[Input1]
Name='x'
Range=[0 1]
NumMFs=2
MF1='a':'trimf',[0 0 1]{footprint}
MF2='b':'gaussmf',[0.2 1],[0.5],[0.1 0.3]

[Output1]
Name='y'
Range=[0 1]
NumMFs=1
MF1='c':{output}

[Rules]
1, 1 (1) : 1
"""
MAMDANI = {"type": "mamdani", "defuzzifier": "centroid", "output": "'trimf',[0 0.5 1]"}
SUGENO = {"type": "sugeno", "defuzzifier": "wtaver", "output": "'linear',[2 -1]"}


@pytest.mark.parametrize(
    ("footprint", "expected"),
    [
        (",[0.9],[0.25 0.25]", Footprint(0.9, 0.25)),
        (" , 0.9 , 0.25", Footprint(0.9, 0.25)),
        (",[0.9],[0.1 0]", Footprint(0.9, 0.1, 0.0)),
        (",[0.9]", Footprint(0.9, 0.2)),
        ("", Footprint(1.0, 0.2)),
    ],
)
def test_type_2(footprint, expected):
    parts = {"reduction": "TypeReductionMethod='eiasc'", "footprint": footprint}
    system = read_fis(TYPE_2.format(**MAMDANI, **parts))
    assert (system.type, system.algorithm) == (2, "eiasc")
    assert [s.lower for s in system.inputs[0].sets] == [expected, Footprint(0.5, 0.1, 0.3)]
    assert system.outputs[0].sets[0].lower == Footprint(1.0, 0.2)
    system = read_fis(TYPE_2.format(**SUGENO, **(parts | {"reduction": ""})))
    assert (system.type, system.algorithm) == (2, "km")
    assert system.outputs[0].sets == (LinearFunction("c", -1.0, (2.0,)),)
    assert read_fis(write_fis(system)) == system


def test_read_paper_file():
    system = load(shared("paper/IT1FUZZY.fis"))
    assert system.name == "IT1FUZZY"
    assert [v.name for v in system.variables] == ["error", "derror", "kp", "ki", "kd"]
    assert (len(system.rules), system.type) == (49, 1)
    assert read_fis(write_fis(system)) == system


@given(systems(**MATLAB_SYSTEMS, names=PRINTABLE_NAMES))
@examples(50)
def test_round_trip_is_lossless(system):
    assert read_fis(write_fis(system)) == system


@given(systems())
@examples(60)
def test_any_system_is_written_completely_or_refused(system):
    try:
        text = write_fis(system)
    except InvalidInput:
        return
    read = read_fis(text)
    assert (read.inputs, read.outputs) == (system.inputs, system.outputs)
    assert {r.weight for r in read.rules} == {r.weight for r in system.rules}


def minimal(**changes):
    low = FuzzySet("low", Membership("trimf", (0, 0, 1)))
    high = FuzzySet("high", Membership("trimf", (0, 1, 1)))
    made = FuzzySystem(
        "simple",
        (InputVariable("x", 0, 1, (low, high)), InputVariable("z", 0, 1, (low, high))),
        (OutputVariable("y", 0, 1, (low, high)),),
        (Rule(Is("x", "low"), (Is("y", "high"),)),),
    )
    return replace(made, **changes)


def with_rule(antecedent):
    return minimal(rules=(Rule(antecedent, (Is("y", "high"),)),))


def with_sets(*sets):
    return minimal(inputs=(InputVariable("x", 0, 1, sets), minimal().inputs[1]))


def with_output(**changes):
    return minimal(outputs=(replace(minimal().outputs[0], **changes),))


LOW, HIGH = minimal().inputs[0].sets
XL, XH, ZL = Is("x", "low"), Is("x", "high"), Is("z", "low")


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        (minimal(conjunction="einstein"), "the conjunction 'einstein'; Matlab has min, prod"),
        (minimal(disjunction="bsum"), "the disjunction 'bsum'"),
        (with_output(aggregation="drastic"), "the aggregation 'drastic'"),
        (with_output(defuzzifier="lm"), "the defuzzifier 'lm'; Matlab has centroid,"),
        (with_output(default=0.25), "the default 0.25 of 'y'"),
        (
            minimal(outputs=(*minimal().outputs, replace(minimal().outputs[0], name="w",
                                                       aggregation="sum"))),
            "one defuzzifier for all outputs, but 'y' has max and centroid, 'w' has sum and",
        ),
        (with_rule(And((XL, Or((XH, ZL))))), "no rules with both 'and' and 'or'; split it"),
        (with_rule(Or((XL, XH))), 'rule "if x is low or x is high then y is high": Matlab has no '
                                  "rules with two propositions about one input"),
        (with_rule(Is("x", "low", ("very",))), "no hedge but 'not'"),
        (with_rule(Is("x", "", ("any",))), "no hedge but 'not'"),
        (with_sets(LOW, replace(HIGH, upper=Membership("pointsmf", (0, 0, 1, 1)))),
         "set 'high' of 'x': Matlab has no pointsmf"),
        (with_sets(LOW, replace(HIGH, lower=Membership("trimf", (0.5, 1, 1)))),
         "set 'high' of 'x': Matlab has no lower function"),
        (with_sets(LOW, replace(HIGH, lower=Footprint(), secondary=Secondary())), "type-3"),
        (replace(minimal().with_footprint(Footprint()), algorithm="nie-tan"),
         "the type reduction 'nie-tan'; Matlab has km, ekm, iasc, eiasc"),
        (minimal(name="two\nlines"), r"the name 'two\nlines'"),
    ],
)  # fmt: skip
def test_unsupported_parts_are_named(system, expected):
    with pytest.raises(InvalidInput) as caught:
        write_fis(system)
    assert expected in str(caught.value)


def test_redundant_groups_are_written():
    system = with_rule(And((And((ZL,)), Or((XL,)))))
    assert write_fis(system).splitlines()[-1] == "1 1, 2 (1) : 1"


@pytest.mark.parametrize(
    ("old", "new", "line", "column", "expected"),
    [
        ("[System]", "System", 3, 1, "expected [System], got 'System'"),
        ("[Input2]", "[Input3]", 22, 1, "expected [Input2] first, got [Input3]"),
        ("[Input2]", "[Input1]", 22, 1, "[Input1] appears twice"),
        ("[Input2]", "[Input65]", 22, 1, "at most [Input64]"),
        ("[Input2]", f"[Input{'9' * 5000}]", 22, 1, "at most [Input64]"),
        ("[Input2]", "[Entry]", 22, 1, "expected [System], [Input1], ..., [Output1], ..., or"),
        (
            "Type='mamdani'",
            "Type='mamdami'",
            5,
            6,
            "Type 'mamdami'; did you mean 'mamdani'?",
        ),
        ("Type='mamdani'", "Type='sugeno'", 13, 14, "no DefuzzMethod 'centroid'; there are wtaver"),
        ("Type='mamdani'", "Typ='mamdani'", 5, 1, "[System] has no key 'Typ'; there are Name,"),
        ("Type='mamdani'", "", 3, 1, "expected Type=... in [System]"),
        ("Type='mamdani'", "Type=mamdani", 5, 6, "the type in single quotes, got 'mamdani'"),
        ("Type='mamdani'", "Type='mamdani' x", 5, 16, "expected the end of the line, got 'x'"),
        ("Type='mamdani'", "Type", 5, 1, "expected 'Key=value' or a [Section], got 'Type'"),
        ("AndMethod='min'", "AndMethod='mine'", 9, 11, "did you mean 'min'?"),
        ("NumInputs=2", "NumInputs=3", 6, 11, "NumInputs is 3, but there are 2 [Input] sections"),
        ("NumInputs=2", "NumInputs=1000000000", 6, 11, "is 1000000000, but there are 2"),
        ("NumInputs=2", "NumInputs=1e999", 6, 11, "a number, got '1e999'"),
        ("NumRules=4", "NumRules=5", 8, 10, "NumRules is 5, but there are 4 lines in [Rules]"),
        ("NumMFs=2", "NumMFs=1e9", 18, 8, "NumMFs is 1000000000, but there are 2 sets"),
        ("Name='wall'", "Name='room'", 23, 6, "there are two variables 'room'"),
        ("Name='fan'", "Name='room'", 37, 6, "there are two variables 'room'"),
        ("Range=[0 40]", "Range=[0 0]", 17, 7, "expected Range=[low high] with low < high, got"),
        ("Range=[0 40]", "Range=[0 NaN]", 17, 10, "expected a number, got 'NaN'"),
        ("Range=[0 40]", "Range=[0 inf]", 17, 10, "must be finite, got 'inf]'"),
        ("Range=[0 40]", "Range=[0 40", 17, 12, "a number or ']', got the end of the line"),
        ("Range=[0 40]", "Range=[0 1 2]", 17, 7, "got [0 1 2]"),
        ("MF2='hot'", "MF3='hot'", 26, 1, "expected MF2 first, got MF3"),
        ("MF2='hot'", "MF999999999='hot'", 26, 1, "expected MF2 first, got MF999999999"),
        ("MF2='hot'", "MF1='hot'", 27, 1, "MF1 appears twice"),
        ("MF2='hot'", "MF01='hot'", 27, 1, "MF1 appears twice"),
        ("MF2='hot'", "MF2='cold'", 26, 1, "the name 'cold' appears twice"),
        (
            "'smf',[5 25]",
            "'smff',[5 25]",
            26,
            11,
            "function 'smff'; did you mean 'smf'?",
        ),
        (
            "'smf',[5 25]",
            "'mymf',[5 25]",
            26,
            11,
            "no membership function 'mymf'; custom functions are not supported: use one of trimf,",
        ),
        ("'smf',[5 25]", "'pointsmf',[5 0]", 26, 11, "no membership function 'pointsmf'"),
        ("'smf',[5 25]", "'constant',[5]", 26, 11, "no membership function 'constant'"),
        ("'smf',[5 25]", "'linsmf',[25 5]", 26, 1, "linsmf [25 5]: needs a <= b"),
        ("'smf',[5 25]", "'smf',[5 25 0 1]", 26, 1, "needs 2 parameters (a, b), got 4"),
        ("'smf',[5 25]", "'smf',[5]", 26, 1, "needs 2 parameters (a, b), got 1"),
        ("'smf',[5 25]", "'smf' [5 25]", 26, 17, "expected ',' after the function, got '[5 25]'"),
        ("'smf',[5 25]", "'smf',[5 25],[1 2]", 26, 24, "expected LowerScale: one number, got 2"),
        ("'smf',[5 25]", "'smf',[5 25],2", 26, 1, "footprint's scale must lie in [0, 1], got 2"),
        ("'smf',[5 25]", "'smf',[5 25],1,1", 26, 1, "footprint's lag must lie in [0, 1), got 1"),
        ("gbellmf',[10 2 40 0]", "gbellmf',[10 2 40 1]", 20, 3, "needs 3 parameters"),
        ("[Rules]", "[Rules]\n3 1, 1 1 (1) : 1", 8, 10, "NumRules is 4, but there are 5"),
        ("1 1, 2 1 (1) : 1", "3 1, 2 1 (1) : 1", 43, 1, "'room' has sets 1 to 2, got '3'"),
        ("1 1, 2 1 (1) : 1", "1 1.5, 2 1 (1) : 1", 43, 3, ".5 is a hedge that is not supported"),
        ("1 1, 2 1 (1) : 1", "1 1.3, 2 1 (1) : 1", 43, 3, ".3 is Octave's 'extremely', a cube"),
        ("1 1, 2 1 (1) : 1", "1 0.2, 2 1 (1) : 1", 43, 3, "'wall' has sets 1 to 2, got '0.2'"),
        ("1 1, 2 1 (1) : 1", "1 x, 2 1 (1) : 1", 43, 3, "number of a set of 'wall', got 'x'"),
        ("1 1, 2 1 (1) : 1", "1, 2 1 (1) : 1", 43, 2, "the number of a set of 'wall', got ', 2"),
        ("1 1, 2 1 (1) : 1", "1 1 1, 2 1 (1) : 1", 43, 5, "2 sets, one per input, got '1, 2"),
        ("1 1, 2 1 (1) : 1", "1 1, 2.2 1 (1) : 1", 43, 6, "a consequent cannot be 'very'"),
        ("1 1, 2 1 (1) : 1", "1 1, 2 1 (2) : 1", 43, 11, "must lie in [0, 1], got 2"),
        ("1 1, 2 1 (1) : 1", "1 1, 2 1 (nan) : 1", 43, 11, "expected a number, got 'nan'"),
        ("1 1, 2 1 (1) : 1", "1 1, 2 1 (1) : 3", 43, 16, "expected 1 (and) or 2 (or), got 3"),
        ("1 1, 2 1 (1) : 1", "1 1, 2 1", 43, 9, "expected '(' before the weight, after the"),
        ("1 1, 2 1 (1) : 1", "0 0, 2 1 (1) : 1", 43, 1, "the rule has no antecedent"),
        ("1 1, 2 1 (1) : 1", "1 1, 0 -0 (1) : 1", 43, 6, "the rule has no consequent"),
    ],
)
def test_errors_name_position_and_cause(old, new, line, column, expected):
    assert old in HEATER
    message = error_of(HEATER.replace(old, new, 1))
    assert message.startswith(f"line {line}, column {column}: ")
    assert expected in message
    assert len(message) < 400


def test_missing_sections_and_parameters():
    assert error_of("").startswith("line 1, column 1: expected [System]")
    assert "expected a section [Input1]" in error_of(
        HEATER.split("[Input1]", maxsplit=1)[0].replace("NumInputs=2", "")
    )
    assert "expected a section [Rules]" in error_of(
        re.sub("NumRules=4", "", HEATER).split("[Rules]")[0]
    )
    assert "'linear' needs 1 coefficients and a constant, got 1" in error_of(
        TYPE_2.format(**(SUGENO | {"output": "'linear',[1]"}), footprint="", reduction="")
    )
    assert "needs 1 to 1000 sets, got 0" in error_of(re.sub(r"NumMFs=1\nMF1='on'.*", "", HEATER))
    many = "\n".join(f"MF{k}='s{k}':'trimf',[0 1 2]" for k in range(1, 3000))
    assert "has more than 2000 lines" in error_of(re.sub(r"NumMFs=1\nMF1='on'.*", many, HEATER))


PIECES = ["[System]", "[Input1]", "[Rules]", "Name='a'", "Range=[0 1]", "MF1=", "'a'", ":", ",",
          "'trimf'", "[0 1 2]", "[", "]", "'", "nan", "1e999", "1", "-1", "(1)", "\n", "%", "#",
          "=", "NumMFs=1", "Type='sugeno'", "\x00", "é", "²", "٣",
          "TypeReductionMethod='km'"]  # fmt: skip


@given(st.text() | st.lists(st.sampled_from(PIECES), max_size=60).map("\n".join))
@examples(150)
def test_arbitrary_text_is_refused(text):
    with pytest.raises(InvalidInput):
        read_fis(text)


@given(st.data())
@examples(200)
def test_mutated_files_are_read_or_refused(data):
    sugeno = TYPE_2.format(**SUGENO, footprint=",[1],[0.1 0.1]", reduction="")
    text = data.draw(st.sampled_from([HEATER, sugeno]))
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        end = min(len(text), start + data.draw(st.integers(0, 5)))
        text = text[:start] + data.draw(st.sampled_from(PIECES) | st.text(max_size=3)) + text[end:]
    try:
        system = read_fis(text)
    except InvalidInput as error:
        assume(str(error))
    else:
        assert isinstance(system, FuzzySystem)


def test_load_and_save(tmp_path):
    path = tmp_path / "simple.FIS"
    save(minimal(), path)
    assert load(path) == load(str(path)) == minimal()
    save(minimal(name="other"), path)
    assert load(path).name == "other"
    with pytest.raises(InvalidInput, match=r"^\S*simple.FIS: a .fis file cannot hold the conj"):
        save(minimal(conjunction="einstein"), path)
    assert load(path).name == "other"
    assert os.listdir(tmp_path) == ["simple.FIS"]


@pytest.mark.parametrize("suffix", [".fll", ".fcl", ".fml", ".fml.xml", ".XML"])
def test_suffix_selects_format(tmp_path, suffix):
    path = tmp_path / f"simple{suffix}"
    save(minimal(), path)
    assert load(path).rules == minimal().rules


def test_load_errors_name_the_file_once(tmp_path):
    path = tmp_path / "bad.fis"
    for content in (b"[System", b"\x00", b"\xff\xfe", b""):
        path.write_bytes(content)
        with pytest.raises(InvalidFuzzyFile, match=r"bad\.fis: ") as caught:
            load(path)
        assert str(caught.value).count("bad.fis") == 1
    for name in ("absent.fis", ".", "nul\x00.fis"):
        with pytest.raises(InvalidFuzzyFile):
            load(tmp_path / name)


def test_unknown_suffix(tmp_path):
    for name in ("a.fiz", "fis", "a.fis.bak"):
        with pytest.raises(InvalidFuzzyFile, match=r"one of \.fis, \.fll, \.fcl, \.fml, \.xml"):
            load(tmp_path / name)
        with pytest.raises(InvalidInput, match=r"one of \.fis"):
            save(minimal(), tmp_path / name)


def test_save_to_unwritable_path(tmp_path):
    with pytest.raises(CannotWrite, match="cannot write"):
        save(minimal(), tmp_path / "absent" / "a.fis")
    (tmp_path / "folder.fis").mkdir()
    with pytest.raises(CannotWrite, match="cannot write"):
        save(minimal(), tmp_path / "folder.fis")
    assert os.listdir(tmp_path) == ["folder.fis"]


def test_load_warns_of_gaps(tmp_path):
    left = FuzzySet("low", Membership("trimf", (0, 0.1, 0.25)))
    right = FuzzySet("high", Membership("trimf", (0.75, 1, 1)))
    save(with_sets(left, right), tmp_path / "gap.fis")
    with pytest.warns(
        GapWarning, match=r"no set of 'x' covers 0, \[0\.25, 0\.75\]; rules may not fire there"
    ):
        load(tmp_path / "gap.fis")


def test_load_states_that_the_sign_of_sigma_has_no_effect(tmp_path):
    """Matlab's exp(-(x - c)^2/(2 sigma^2)) accepts a negative sigma."""
    left = FuzzySet("low", Membership("gaussmf", (-0.4, 0)))
    right = FuzzySet("high", Membership("gauss2mf", (0.4, 0.9, -0.4, 1)))
    save(with_sets(left, right), tmp_path / "signs.fis")
    with pytest.warns(SigmaWarning, match="negative in 'x' is 'low', 'x' is 'high'; the formula"):
        found = load(tmp_path / "signs.fis")
    assert found.inputs[0].sets[0] == left
    at = np.linspace(-1, 1, 21)
    assert (left.upper(at) == Membership("gaussmf", (0.4, 0))(at)).all()


def test_large_file_is_refused_unread(tmp_path):
    path = tmp_path / "huge.fis"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    with (
        allocates_at_most(20e6),
        pytest.raises(InvalidFuzzyFile, match="larger than the limit of 8 MB"),
    ):
        load(path)


@pytest.mark.parametrize(
    "text",
    [
        "[System]\n" + "'" * 1_000_000,
        "[" * 1_000_000,
        "[System]\nName=" + "'" * 999_999,
        "[System]\nType='" + "a" * 1_000_000 + "'",
        "[System]\n" + " " * 1_000_000 + "x",
        "[System]\nNumInputs=" + "9" * 1_000_000,
        "[System]\nA" + "b" * 1_000_000,
        "[Rules]\n" + "1\n" * 500_000,
        HEATER.replace("[5 25]", f"[{'1 ' * 500_000}]"),
        HEATER + "[Rules" + " " * 1_000_000,
        HEATER + "[Rules" + " " * 1_000_000 + "x",
        HEATER + "[Input" + "1" * 1_000_000,
    ],
    ids=range(12),
)
def test_parsing_time_is_not_quadratic(text):
    # processor time: a few seconds if linear, hours if quadratic
    start = time.thread_time()
    message = error_of(text)
    assert time.thread_time() - start < 60.0
    assert len(message) < 400
