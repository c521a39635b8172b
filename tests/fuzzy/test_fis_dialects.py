"""Matlab's .fis files as its old versions and its examples write them."""

from dataclasses import replace

import numpy as np
import pytest

from omnidrive.errors import InvalidFuzzyFile
from omnidrive.fuzzy import Inference
from omnidrive.fuzzy.files import load, save
from omnidrive.fuzzy.files.fis import read_fis
from omnidrive.fuzzy.files.fml import write_fml
from omnidrive.fuzzy.membership import MATLAB_SHAPES, SHAPES
from omnidrive.fuzzy.rules import And, Is
from omnidrive.fuzzy.variables import LinearFunction

OLD = """\
[System]
Name='steps'
Type='mamdani'
Version=1.0
NumInputs=1
NumOutputs=1
NumRules=2
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'

[Input1]
Name='err'
Range=[-10 10]
NumMFs=2
MF1='n':'zmf',[-5 5 0 0]
MF2='p':'smf',[-5 5 0 0]

[Output1]
Name='drive'
Range=[-50 50]
NumMFs=2
MF1='back':'trimf',[-80 -50 -20 0]
MF2='ahead':'trimf',[0 20 40 0]

[Rules]
1, 1 (1) : 1
2, 2 (1) : 1
"""

PARKING = """\
[System]
Name='sltbu'
Type='sugeno'
Version=2.0
NumInputs=3
NumOutputs=1
NumRules=2
AndMethod='prod'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='wtaver'

[Input1]
Name='distance'
Range=[0 25]
NumMFs=2
MF1='near':'zmf',[1 2]
MF2='far':'smf',[1 2]

[Input2]
Name='control1'
Range=[-0.785 0.785]
NumMFs=0

[Input3]
Name='control2'
Range=[-0.785 0.785]
NumMFs=0

[Output1]
Name='control'
Range=[-0.785 0.785]
NumMFs=2
MF1='out1mf1':'linear',[0 0 1 0]
MF2='out1mf2':'linear',[0 1 0 0]

[Rules]
1 0 0, 1 (1) : 1
2 0 0, 2 (1) : 1
"""
"""Matlab's example of a truck that parks: two of its inputs have no sets."""


def test_padded_parameters_are_ignored():
    padded = read_fis(OLD)
    plain = OLD.replace(" 0 0]", "]").replace(" 0]\n", "]\n")
    assert padded == read_fis(plain)
    # the value of the file without padding
    assert Inference(padded)(2.0)[0] == pytest.approx(8.597824116047144, rel=1e-12)


@pytest.mark.parametrize("shape", MATLAB_SHAPES)
@pytest.mark.parametrize("version", ["1.0", "2.0", "3.0"])
def test_every_shape_may_be_padded(shape, version):
    parameters = " ".join(str(k + 1) for k in range(len(SHAPES[shape].parameters)))
    text = OLD.replace("Version=1.0", f"Version={version}")
    line = "'zmf',[-5 5 0 0]"
    exact = read_fis(text.replace(line, f"'{shape}',[{parameters}]"))
    assert read_fis(text.replace(line, f"'{shape}',[{parameters} 0 0]")) == exact
    assert read_fis(text.replace(line, f"'{shape}',[{parameters},0.0,-0]")) == exact
    for wrong in (f"{parameters} 0 1", f"{parameters} 5", parameters[:-2] or "[]"):
        with pytest.raises(InvalidFuzzyFile, match=f"needs {len(SHAPES[shape].parameters)} param"):
            read_fis(text.replace(line, f"'{shape}',[{wrong}]"))


def test_padded_functions():
    text = PARKING.replace("'linear',[0 0 1 0]", "'constant',[5 0 0 0]").replace(
        "'linear',[0 1 0 0]", "'linear',[0 1 0 2 0]"
    )
    assert read_fis(text).outputs[0].sets == (
        LinearFunction("out1mf1", 5.0),
        LinearFunction("out1mf2", 2.0, (0.0, 1.0, 0.0)),
    )
    for wrong in ("'constant',[5 0 1]", "'linear',[0 1 0 0 1]", "'linear',[0 1 0]"):
        with pytest.raises(InvalidFuzzyFile, match="needs"):
            read_fis(PARKING.replace("'linear',[0 1 0 0]", wrong))


def test_inputs_without_sets(tmp_path):
    system = read_fis(PARKING)
    assert system.inputs[1].sets == ()
    infer = Inference(system)
    # zmf [1 2] at 1.25 is 1 - 2/16 = 0.875
    assert infer(1.25, 0.2, -0.4)[0] == pytest.approx(0.875 * -0.4 + 0.125 * 0.2, abs=1e-15)
    at = np.array([[0.0, 0.1, 0.3], [25.0, 0.1, 0.3]])
    assert np.allclose(infer(at)[:, 0], [0.3, 0.1])
    for suffix in (".fis", ".fll"):
        save(system, tmp_path / f"truck{suffix}")  # no warning of gaps: no rule can miss one
        assert load(tmp_path / f"truck{suffix}") == system
    save(replace(system, conjunction="min"), tmp_path / "truck.fml")
    assert load(tmp_path / "truck.fml").inputs == system.inputs


def test_rules_of_inputs_without_sets():
    with pytest.raises(InvalidFuzzyFile, match="'control1' has no sets, got '1'"):
        read_fis(PARKING.replace("1 0 0, 1", "1 1 0, 1"))
    system = read_fis(PARKING)
    rule = replace(
        system.rules[0],
        antecedent=And((Is("distance", "near"), Is("control1", "", ("any",)))),
    )
    always = replace(system, rules=(rule, *system.rules[1:]))
    assert Inference(always)(1.25, 0.2, -0.4)[0] == Inference(system)(1.25, 0.2, -0.4)[0]
    with pytest.raises(Exception, match="FML needs a set of 'control1' for 'any'"):
        write_fml(replace(always, disjunction="max"))


def test_outputs_without_sets_are_refused():
    text = OLD.replace("NumMFs=2\nMF1='back':'trimf',[-80 -50 -20 0]\n", "NumMFs=0\n")
    text = text.replace("MF2='ahead':'trimf',[0 20 40 0]\n", "")
    with pytest.raises(InvalidFuzzyFile, match="'drive' needs 1 to 1000 sets, got 0"):
        read_fis(text)
