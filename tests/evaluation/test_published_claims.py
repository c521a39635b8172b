"""Claims of the paper, checked on synthetic studies in which they hold or not."""

import numpy as np
import pyarrow as pa
import pytest

from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS
from omnidrive.evaluation.tables.published_claims import (
    CLAIMS,
    FAILS,
    HOLDS,
    OPEN,
    check_claims,
    claims_table,
    published_table,
)
from tests.evaluation.synthetic_runs import synthetic_table

TASKS = (("track", 20.0, ""), ("track", 30.0, ""), ("noise", 30.0, ""))
NAMES = ("fuzzy_t1", "fuzzy_t2", "unicycle-nmpc")


def study(scale=None, repetitions=20, own=1e-5):
    """Return a study with the published errors, times ``scale`` by controller."""
    table = synthetic_table(dict.fromkeys(NAMES, 0.0), repetitions=repetitions, tasks=TASKS)
    rng = np.random.default_rng(3)
    rows = list(zip(*(table[k].to_pylist() for k in ("task", "duration", "controller")),
                    strict=True))  # fmt: skip
    for metric in ("me", "mae", "me_measured", "mae_measured"):
        values = [
            getattr(PUBLISHED_ERRORS[row], metric.removesuffix("_measured"))
            * (scale or {}).get(row[2], 1.0)
            + own * rng.normal()
            for row in rows
        ]
        if metric in table.column_names:
            table = table.drop_columns([metric])
        table = table.append_column(metric, pa.array(values))
    return StudyEvidence(RunTable(table))


def verdicts(found):
    return {each.text: each.verdict for each in check_claims(found)}


def test_published_values_support_the_claims_about_errors():
    found = verdicts(study())
    assert found["Without noise, NMPC has lower errors than both fuzzy PIDs."] == HOLDS
    assert found["Without noise, the two fuzzy PIDs have similar errors."] == HOLDS
    assert found["NMPC is more robust to noise than both fuzzy PIDs."] == HOLDS
    assert found["The type-2 fuzzy PID rejects noise better than the type-1 one."] == HOLDS
    assert found["With 30 s instead of 20 s, both kinds have lower errors."] == HOLDS
    assert len(found) == 5  # no step response, no computing time


def test_worse_nmpc_contradicts_the_claims():
    found = verdicts(study({"unicycle-nmpc": 2.0}))
    assert found["Without noise, NMPC has lower errors than both fuzzy PIDs."] == FAILS
    assert found["Without noise, the two fuzzy PIDs have similar errors."] == HOLDS
    assert verdicts(study({"fuzzy_t2": 1.5}))[
        "Without noise, the two fuzzy PIDs have similar errors."
    ] == FAILS  # fmt: skip


def test_much_noise_and_one_repetition_show_nothing():
    found = verdicts(study(own=0.1))
    assert found["The type-2 fuzzy PID rejects noise better than the type-1 one."] == OPEN
    assert found["Without noise, the two fuzzy PIDs have similar errors."] == OPEN
    assert verdicts(study(repetitions=1)) == {}


def test_step_response_and_computing_time():
    table = synthetic_table(
        dict.fromkeys(NAMES, 1.0), tasks=(("step", 10.0, ""),), own=1e-3, metric="overshoot_x",
        value=lambda n, _: n != "unicycle-nmpc",
    )  # fmt: skip
    timing = pa.table({
        "number": table["number"],
        "step_time_median": [1.0 + len(n) + 1e-3 * k
                             for k, n in enumerate(table["controller"].to_pylist())],
    })  # fmt: skip
    found = StudyEvidence(RunTable(table, timing))
    assert verdicts(found) == {"NMPC has the smallest overshoot in the step response.": HOLDS}
    tracks = synthetic_table(dict.fromkeys(NAMES, 1.0), tasks=TASKS[:1])
    timing = pa.table({
        "number": tracks["number"],
        "step_time_median": [float(len(n)) for n in tracks["controller"].to_pylist()],
    })  # fmt: skip
    found = verdicts(StudyEvidence(RunTable(tracks, timing)))
    assert found["The fuzzy PIDs need less computing time than NMPC."] == HOLDS


def test_tables_show_claims_and_values():
    found = study()
    table = claims_table(check_claims(found))
    assert table.lead == "5 of 5 claims of the paper hold."
    assert len(table.rows) == 5
    assert "ME, track 20 s: unicycle-nmpc is better than fuzzy_t1 by 15.2" in table.rows[0][2]
    values = published_table(found)
    assert len(values.rows) == 2 * len(PUBLISHED_ERRORS)
    assert values.rows[0][:4] == ("track 20 s", "fuzzy_t1", "ME, mm", "87.4")
    assert all(float(row[-1]) == pytest.approx(1.0, abs=1e-3) for row in values.rows)


def test_claims_name_known_controllers_and_quantities():
    for claim in CLAIMS:
        assert {claim.better, *claim.others} <= set(NAMES)
