from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files.fml import read_fml, write_fml
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rules import And, Is, Or
from omnidrive.fuzzy.variables import Footprint, LinearFunction
from tests.examples import examples
from tests.fuzzy.mutations import mutated
from tests.fuzzy.systems import PRINTABLE_NAMES, systems

MAMDANI = """\
<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<fuzzySystem xmlns="http://www.ieee1855.org" name="heater - small">
  <knowledgeBase>
    <fuzzyVariable name="room" scale="" domainleft="-10.0" domainright="40.0" type="input">
      <fuzzyTerm name="cold" complement="false"><leftLinearShape param1="5" param2="18"/></fuzzyTerm>
      <fuzzyTerm name="fine"><gaussianShape param1="21.0" param2="3.0"/></fuzzyTerm>
      <fuzzyTerm name="not hot" complement="True">
        <rightGaussianShape param1="30.0" param2="2.0"/>
      </fuzzyTerm>
      <fuzzyTerm name="low"><leftGaussianShape param1="0.0" param2="2.0"/></fuzzyTerm>
      <fuzzyTerm name="mid"><piShape param1="10" param2="15"/></fuzzyTerm>
    </fuzzyVariable>
    <fuzzyVariable name="power" domainleft="0" domainright="100" type="Output"
                   accumulation="PROBOR" defuzzifier="LM" defaultValue="3">
      <fuzzyTerm name="weak"><rectangularShape param1="0" param2="20"/></fuzzyTerm>
      <fuzzyTerm name="strong">
        <pointSetShape interpolationMethod="linear">
          <point x="50" y="0"/><point x="80" y="0.9"/><point x="90" y="1"/>
        </pointSetShape>
      </fuzzyTerm>
    </fuzzyVariable>
  </knowledgeBase>
  <mamdaniRuleBase name="rules" activationMethod="PROD" andMethod="MIN" orMethod="BSUM">
    <rule name="rule1" andMethod="BSUM" connector="and" weight="0.5">
      <antecedent>
        <clause><variable>room</variable><term>cold</term></clause>
        <clause modifier="intensify"><variable>room</variable><term>not hot</term></clause>
      </antecedent>
      <consequent><then><clause><variable>power</variable><term>strong</term></clause></then></consequent>
    </rule>
    <rule name="rule2" connector="OR">
      <antecedent>
        <clause modifier="any"><variable>room</variable><term>cold</term></clause>
        <clause modifier="very"><variable>room</variable><term>fine</term></clause>
      </antecedent>
      <consequent><then><clause modifier="not"><variable> power </variable><term>weak</term></clause></then></consequent>
    </rule>
  </mamdaniRuleBase>
</fuzzySystem>
"""  # noqa: E501

TSK = """\
<f:fuzzySystem xmlns:f="http://www.ieee1855.org" f:name="s">
  <f:knowledgeBase>
    <f:tskVariable name="y" combination="WA">
      <f:tskTerm name="flat" order="0"><f:tskValue>1.5</f:tskValue></f:tskTerm>
      <f:tskTerm name="tilted" order="1">
        <f:tskValue>1</f:tskValue><f:tskValue>2</f:tskValue><f:tskValue>-3</f:tskValue>
      </f:tskTerm>
    </f:tskVariable>
    <f:fuzzyVariable name="a" domainleft="0" domainright="1">
      <f:fuzzyTerm name="on"><f:sShape param1="0" param2="1"/></f:fuzzyTerm>
    </f:fuzzyVariable>
    <f:fuzzyVariable name="b" domainleft="0" domainright="2">
      <f:fuzzyTerm name="on"><f:zShape param1="0" param2="1"/></f:fuzzyTerm>
    </f:fuzzyVariable>
  </f:knowledgeBase>
  <f:tskRuleBase name="rules">
    <f:tskRule name="r">
      <f:antecedent><f:clause><f:variable>a</f:variable><f:term>on</f:term></f:clause></f:antecedent>
      <f:tskConsequent><f:tskThen><f:tskClause>
        <f:variable>y</f:variable><f:term>tilted</f:term>
      </f:tskClause></f:tskThen></f:tskConsequent>
    </f:tskRule>
  </f:tskRuleBase>
</f:fuzzySystem>
"""


def test_read_mamdani():
    system = read_fml(MAMDANI)
    (room,), (power,) = system.inputs, system.outputs
    assert system.name == "heater - small"
    assert [each.upper for each in room.sets[:2]] == [
        Membership("linzmf", (5, 18)),
        Membership("gaussmf", (3, 21)),
    ]
    assert room.sets[4].upper == Membership("pimf", (10, 15, 15, 20))
    assert power.sets[0].upper == Membership("trapmf", (0, 0, 20, 20))
    assert power.sets[1].upper == Membership("pointsmf", (50, 0, 80, 0.9, 90, 1))
    assert (power.aggregation, power.defuzzifier, power.default) == ("probor", "lm", 3.0)
    assert (system.conjunction, system.disjunction) == ("lukasiewicz", "bsum")
    assert system.implication == "prod"
    first, second = system.rules
    complement = Is("room", "not hot", ("extremely", "not"))
    assert first.antecedent == And((Is("room", "cold"), complement))
    assert first.weight == 0.5
    assert second.antecedent == Or((Is("room", "", ("any",)), Is("room", "fine", ("very",))))
    assert second.consequents == (Is("power", "weak", ("not",)),)


def test_one_sided_gaussians():
    _, _, right, left, _ = read_fml(MAMDANI).inputs[0].sets
    side = Membership("gaussmf", (2.0, 0.0))
    assert [left.upper(x) for x in (-1e99, -5.0, 0.0, 1.0)] == [1.0, 1.0, 1.0, side(1.0)]
    assert [right.upper(x) for x in (29.0, 30.0, 1e99)] == [side(1.0), 1.0, 1.0]


def test_read_sugeno():
    system = read_fml(TSK)
    (y,) = system.outputs
    assert y.sets == (LinearFunction("flat", 1.5), LinearFunction("tilted", 1.0, (2.0, -3.0)))
    assert (y.low, y.high, y.default) == (-5.0, 3.0, 0.0)
    assert (system.conjunction, system.disjunction, system.implication) == ("min", "max", "min")


def test_read_write_read():
    for text in (TSK, MAMDANI.replace('complement="True"', "")):
        system = read_fml(text.replace('modifier="intensify"', ""))
        assert read_fml(write_fml(system)) == system


def as_read(system):
    """Return the system as it is read: no ineffective aggregations and no redundant defaults."""
    return replace(
        system,
        outputs=tuple(
            replace(
                v,
                aggregation="max" if v.is_sugeno else v.aggregation,
                default=None if v.fallback == 0.5 * (v.low + v.high) else v.default,
            )
            for v in system.outputs
        ),
    )


@examples(60)
@given(
    systems(
        types=(1,),
        names=PRINTABLE_NAMES,
        shapes=("trimf", "trapmf", "linsmf", "linzmf", "gaussmf", "smf", "zmf", "pointsmf"),
        aggregations=("max", "probor", "bsum", "drastic", "einstein", "hamacher", "nilpotent"),
        defuzzifiers=("centroid", "bisector", "mom", "lm", "rm", "wtaver"),
        nesting=1,
    ).filter(lambda system: all(len(t.hedges) < 2 for r in system.rules for t in propositions(r)))
)
def test_round_trip(system):
    assert read_fml(write_fml(system)) == as_read(system)


def propositions(rule):
    return (rule.antecedent,) if isinstance(rule.antecedent, Is) else rule.antecedent.parts


@pytest.mark.parametrize(
    ("old", "new", "position", "message"),
    [
        ("<knowledgeBase>", "<!DOCTYPE x><knowledgeBase>", "line 3", "not XML"),
        ("<fuzzySystem", "<fuzzy", "line 39", "mismatched tag"),
        ("fuzzySystem", "system", "line 2, column 1", "expected fuzzySystem"),
        ('domainright="40.0"', 'domainright="-10"', "line 4, column 5", "must have a width"),
        (
            'domainright="40.0"',
            'domainright="INF"',
            "line 4, column 5",
            "inf is not a finite",
        ),
        ('domainright="40.0"', 'domainright="NaN"', "line 4, column 5", "number"),
        ('domainright="40.0"', "", "line 4, column 5", "domainright"),
        ('type="input"', 'type="both"', "line 4, column 5", "'both'"),
        ('name="power"', 'name="room"', "", "'room' is there twice"),
        ('name="fine"', 'name="cold"', "line 4, column 5", "'cold' is there twice"),
        ('complement="True"', 'complement="2"', "line 7, column 7", "true or false"),
        ("gaussianShape", "customShape", "line 6, column 30", "customShape"),
        ("gaussianShape", "circularShape", "line 6, column 30", "circularShape"),
        ('param2="18"', 'param2="4"', "line 5, column 49", "a <= b"),
        ('param2="18"', "", "line 5, column 49", "param2"),
        ('param2="18"', 'param2="18" param3="4"', "line 5, column 49", "param3"),
        ('"linear"', '"lagrange"', "line 17, column 9", "lagrange"),
        ('y="0.9"', 'y="1.9"', "line 17, column 9", "[0, 1]"),
        ('accumulation="PROBOR"', 'accumulation="SUM"', "line 13, column 5", "'SUM'"),
        ('defuzzifier="LM"', 'defuzzifier="custom_x"', "line 13, column 5", "custom_x"),
        ('activationMethod="PROD"', 'activationMethod="DRS"', "line 23, column 3", "DRS"),
        ("mamdaniRuleBase", "tsukamotoRuleBase", "line 23, column 3", "tsukamotoRuleBase"),
        ('modifier="intensify"', 'modifier="extremely"', "line 27, column 9", "extremely"),
        ('connector="and"', 'connector="xor"', "line 24, column 5", "xor"),
        ('connector="OR"', 'connector="and"', "line 31, column 5", "rules before it"),
        ('weight="0.5"', 'weight="2"', "line 24, column 5", "[0, 1]"),
        ("<term>cold", "<term>colt", "line 24, column 5", "'cold'"),
        ("<variable>room", "<variable>roam", "line 24, column 5", "'room'"),
        ("</then>", "</then><else/>", "line 29, column 94", "else"),
    ],
)
def test_read_errors(old, new, position, message):
    assert old in MAMDANI
    count = -1 if old in {"fuzzySystem", "gaussianShape", "mamdaniRuleBase"} else 1
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fml(MAMDANI.replace(old, new, count))
    assert position in str(error.value)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<f:tskValue>2</f:tskValue>", "", "expected 3 values, got 2"),
        ('order="1"', 'order="2"', "expected 0 or 1"),
        ('"WA"', '"SUM"', "'SUM'"),
        ("<f:tskValue>1.5", "<f:tskValue>1,5", "number"),
        ("<f:tskValue>1.5", "<f:tskValue>1e999", "a number, got"),
        ("</f:tskVariable>", "<?omnidrive 0 1?></f:tskVariable>", "domainleft"),
    ],
)
def test_sugeno_read_errors(old, new, message):
    with pytest.raises(InvalidFuzzyFile) as error:
        read_fml(TSK.replace(old, new, 1))
    assert message in str(error.value)


def test_write_errors():
    system = read_fml(MAMDANI.replace('modifier="intensify"', ""))
    (power,) = system.outputs
    both = And((Is("room", "cold"), Or((Is("room", "fine"), Is("room", "low")))))
    two = Is("room", "cold", ("not", "very"))
    for changed, message in (
        (system.with_footprint(Footprint(0.5)), "type 2"),
        (replace(system, name="\x00"), "name"),
        (replace(system, rules=(replace(system.rules[0], antecedent=both),)), "split it"),
        (replace(system, rules=(replace(system.rules[0], antecedent=two),)), "one modifier"),
        (replace(system, outputs=(replace(power, aggregation="sum"),)), "'sum'"),
        (replace(system, outputs=(replace(power, defuzzifier="som"),)), "'som'"),
    ):
        with pytest.raises(InvalidInput, match=message):
            write_fml(changed)
    sigmoid = replace(power.sets[0], upper=Membership("sigmf", (1, 2)))
    with pytest.raises(InvalidInput, match="sigmf"):
        write_fml(replace(system, outputs=(replace(power, sets=(sigmoid, power.sets[1])),)))


def test_entity_expansion_is_refused():
    attack = '<?xml version="1.0"?>\n<!DOCTYPE l [<!ENTITY a "ha">'
    attack += "".join(
        f'<!ENTITY {n} "&{m};&{m};&{m};">' for m, n in zip("abcde", "bcdef", strict=True)
    )
    with pytest.raises(InvalidFuzzyFile, match="line 2, column 13: a DOCTYPE is not supported"):
        read_fml(f"{attack}]><fuzzySystem>&f;</fuzzySystem>")
    with pytest.raises(InvalidFuzzyFile, match="not XML"):
        read_fml("<fuzzySystem>&f;</fuzzySystem>")


def test_nesting_and_text_limits():
    with pytest.raises(InvalidFuzzyFile, match="nested"):
        read_fml("<a>" * 100_000)
    with pytest.raises(InvalidFuzzyFile, match="more than 1000 characters"):
        read_fml("<a>" + "b<!-- -->" * 100_000)


PIECES = ["&lt;", "&a;", "<", "/>", "nan", "inf", "1e999", "\0", "\ud800", "<a>", "custom_x", "MAX"]


@examples(150)
@given(mutated([MAMDANI, TSK], PIECES) | st.text())
def test_mutated_text_is_read_or_refused(text):
    try:
        system = read_fml(text)
        again = write_fml(system)
    except InvalidInput:
        return
    assert read_fml(again) == as_read(system)
