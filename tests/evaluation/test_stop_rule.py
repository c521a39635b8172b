"""Stop rule of sequential studies."""

from math import inf

import numpy as np
import pyarrow as pa
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.evaluation.statistics.stop_rule import StopRule, leading_repetitions
from tests.evaluation.synthetic_runs import TASK, synthetic_table, with_repeats

RULE = StopRule.parse("me:0.1mm")
TWO = {"fuzzy_t1": 0.05, "fuzzy_t2": 0.049}


def test_rule_is_parsed_with_its_unit():
    assert RULE.measure.name == "me"
    assert RULE.half_width == pytest.approx(1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [("me", "write QUANTITY:HALF_WIDTH"), ("mee:1mm", "did you mean 'me'"),
     ("me:0mm", "need above 0"), ("me:-1mm", "need above 0"), ("me:1kg", "not a unit of me"),
     ("me:", "not a value of me")],
)  # fmt: skip
def test_bad_rules_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        StopRule.parse(text)


def test_study_ends_when_every_pair_is_narrow_enough():
    table = synthetic_table(TWO, repetitions=200, common=1e-2, own=3e-4)
    states = [RULE.check(table.slice(0, 2 * n)) for n in (10, 20, 100, 200)]
    assert [s.reached for s in states] == [False, False, False, True]
    assert states[0].half_width == inf
    assert [s.repetitions for s in states] == [10, 20, 100, 200]
    assert states[2].needed == pytest.approx(200, rel=0.4)
    assert "goal ±0.100 mm" in states[2].text
    assert "reached ±0.100 mm" in states[3].text


def test_more_comparisons_need_more_repetitions():
    two = RULE.check(synthetic_table(TWO, repetitions=60))
    tasks = (TASK, ("track", 20.0, ""))
    more = RULE.check(synthetic_table(TWO | {"pid": 0.06}, repetitions=60, tasks=tasks))
    assert more.half_width > 1.05 * two.half_width


def test_single_controller_has_its_mean():
    state = RULE.check(synthetic_table({"pid": 0.05}, repetitions=60, common=1e-3, own=0.0))
    assert state.half_width == pytest.approx(3.4e-3 / np.sqrt(60), rel=0.25)


def test_only_complete_leading_repetitions_count():
    table = synthetic_table(TWO, repetitions=40)
    whole = RULE.check(table.slice(0, 60))
    shuffled = pa.concat_tables([table.slice(66, 14), table.slice(0, 61)])
    assert leading_repetitions(shuffled).repetitions == 30
    assert RULE.check(shuffled)[:3] == pytest.approx(whole[:3])
    assert RULE.check(table.slice(0, 0)).text == "no complete repetition"


def test_study_without_the_quantity_would_not_end():
    with pytest.raises(InvalidInput, match="no run has a value of me"):
        RULE.check(synthetic_table(TWO, failures={(n, r) for n in TWO for r in range(20)}))
    with pytest.raises(InvalidInput, match="no metric 'mae'"):
        StopRule.parse("mae:1mrad").check(synthetic_table(TWO))


def test_needed_repetitions_with_repeats_are_fewer():
    table = synthetic_table({"a": 1e-3, "b": 2e-3}, repetitions=40)
    rule = StopRule.parse("me:0.001mm")
    state, single = rule.check(with_repeats(table, 4)), rule.check(table)
    assert state.repetitions == 10
    assert state.half_width == single.half_width
    assert state.needed == pytest.approx(single.needed / 4)
