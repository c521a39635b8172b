"""Fuzzy rules and sets that tables and figures of a study show: those of its controllers."""

import numpy as np
import pytest

import omnidrive as od
from omnidrive.control.pid.gain_tuning import OUTPUTS
from omnidrive.control.pid.rules import LABELS, paper_rules
from omnidrive.evaluation.figures.membership import membership_functions
from omnidrive.evaluation.tables.rule_tables import rule_tables
from omnidrive.study.setup_facts import controller_types

CHANGED = (paper_rules()[:, :, 0] - LABELS.index("ZO")).tolist()
CHANGED[3][3] = 3


def systems(preset="paper", **controllers):
    scenario = od.paper_scenario().with_values(controllers=controllers, preset=preset)
    types = controller_types(scenario)
    return {label: each.fuzzy for label, each in types.items() if each.fuzzy is not None}


def changed(**fuzzy):
    return {"type": "fuzzy_t1", "fuzzy": fuzzy}


def test_rule_of_a_controller_is_shown_beside_that_of_the_paper():
    (table,) = rule_tables(systems(mine=changed(rules={"kp": CHANGED})))
    assert table.rows[3][4] == "PB/ZO/NS (paper ZO/ZO/NS)"
    assert sum("paper" in cell for row in table.rows for cell in row) == 1


def test_each_rule_base_has_a_table_that_names_its_controllers():
    both = systems(mine=changed(rules={"kp": CHANGED}), a="fuzzy_t1", b="fuzzy_t2", c="pid")
    assert [table.title for table in rule_tables(both)] == [
        "Fuzzy rules of mine: change of kp/ki/kd",
        "Fuzzy rules of a, b: change of kp/ki/kd",
    ]


def test_rules_follow_the_preset_of_each_controller():
    code, paper = rule_tables(
        systems("published-code", a="fuzzy_t1", b={"type": "fuzzy_t1", "preset": "paper"})
    )
    assert sum("paper" in cell for row in code.rows for cell in row) == 2
    assert not any("paper" in cell for row in paper.rows for cell in row)


def test_paper_table_is_that_of_the_rules():
    (table,) = rule_tables(systems(a="fuzzy_t2"))
    cells = np.array([[cell.split("/") for cell in row[1:]] for row in table.rows])
    assert cells.shape == (7, 7, len(OUTPUTS))
    assert (cells == np.array(LABELS)[paper_rules()]).all()


@pytest.mark.parametrize(
    ("controllers", "titles"),
    [
        ({"a": "fuzzy_t1"}, ["Type-1"]),
        ({"a": "fuzzy_t1", "b": changed(rules={"kp": CHANGED})}, ["Type-1"]),
        ({"a": "fuzzy_t1", "b": "fuzzy_t3"}, ["Type-1", "Interval type-3"]),
        ({"a": "fuzzy_t1", "b": changed(error={"small": 0.1})},
         ["a: type-1", "b: type-1", "b: type-1"]),
    ],
)  # fmt: skip
def test_membership_functions_are_those_of_the_controllers(controllers, titles):
    figure = membership_functions(systems(**controllers))
    left = figure.axes[::2]
    assert [axes.get_title() for axes in left] == [f"{t} sets of the inputs" for t in titles]
    if len(titles) == 3:
        peaks = np.sort([text.xy[0] for text in left[1].texts])
        assert peaks[4] == pytest.approx(0.1, abs=1e-3)
        assert left[2].get_xlabel() == "change of error de"
