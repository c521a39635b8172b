"""Verdict, tables, figures and page of a study."""

import re
from hashlib import sha256
from html import escape

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from omnidrive.errors import InvalidInput, one_line
from omnidrive.evaluation.figures.catalogue import drawings, drawn
from omnidrive.evaluation.figures.study_axes import axis_curves
from omnidrive.evaluation.figures.study_cost import CostPoint, cost_points, pareto_front
from omnidrive.evaluation.figures.study_distributions import paired_intervals
from omnidrive.evaluation.figures.style import figure_style
from omnidrive.evaluation.page import PageFigure
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.statistics.uncertainty import MeanEstimate
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_report import StudyReport
from omnidrive.evaluation.study_verdicts import study_verdicts
from omnidrive.evaluation.tables.result_tables import interval_note
from omnidrive.evaluation.tables.table import percent
from tests.evaluation.recorded import page_text, tables_by_title
from tests.evaluation.synthetic_runs import TASK, synthetic_table

EFFECTS = {"pid": 0.06, "fuzzy_t1": 0.0505, "fuzzy_t2": 0.05, "mine<script>": 0.05}
TIMES = {"pid": 3.0, "fuzzy_t1": 20.0, "fuzzy_t2": 40.0, "mine<script>": 300.0}
FACTS = StudyFacts(
    "friction", question="Which <controller> is best?", setup={"Plant": "planar"}, planned=400,
    definition="name: <b>", command="omnidrive study study.yaml", hashes={"Results": "ab" * 32},
    published="claims",
)  # fmt: skip


@pytest.fixture(scope="module")
def study():
    table = synthetic_table(
        EFFECTS, repetitions=12, axes={"mass": [50.0, 75.0], "plant": ["planar", "kinematic"]},
        tasks=(TASK, ("track", 20.0, "")), own=3e-4,
        failures={("pid", r) for r in range(5)},
        value=lambda n, f: 2e-4 * f["mass"] * (2.0 if n == "pid" else 1.0),
    )  # fmt: skip
    times = [TIMES[name] for name in table["controller"].to_pylist()]
    timing = pa.table({"number": table["number"], "step_time_median": times})
    return StudyEvidence(RunTable(table, timing))


def test_verdict_names_the_best_and_those_that_are_not_worse(study):
    noise, track = study_verdicts(study)
    assert noise.evidence.task.label == "noise 30 s"
    assert noise.evidence.measure.name == "me"
    for verdict in (noise, track):
        # pid has 7 repetitions in common with others, too few for 6 pairs
        assert set(verdict.evidence.best) == {"fuzzy_t2", "mine<script>", "pid"}
        assert "no difference in ME is shown between" in verdict.lead
        assert verdict.lead.endswith("the others are worse.")
        assert len(verdict.sentences) == 3
        assert verdict.success.pair("pid", "fuzzy_t1").difference.mean < 0.0
    with pytest.raises(InvalidInput, match="no metric 'work'"):
        study_verdicts(study, "work")


def test_best_controller_that_fails_is_named():
    table = synthetic_table({"a": 0.04, "b": 0.05}, repetitions=40,
                            failures={("a", r) for r in range(20)})  # fmt: skip
    (verdict,) = study_verdicts(StudyEvidence(RunTable(table)))
    assert verdict.lead.startswith("Noise 30 s: a is best, ME ")
    assert verdict.lead.endswith("But a finishes 50 % of its runs, b 100 %.")


def test_single_controller_and_single_repetition_claim_nothing():
    (alone,) = study_verdicts(StudyEvidence(RunTable(synthetic_table({"a": 0.04}))))
    assert alone.lead.startswith("Noise 30 s: a has ME ")
    one = RunTable(synthetic_table({"a": 0.04, "b": 0.05}, repetitions=1))
    (verdict,) = study_verdicts(StudyEvidence(one))
    assert "is best in one run; check with --noise-seeds 20 or more repetitions." in verdict.lead


def test_study_without_valid_runs_has_a_verdict():
    lost = {(n, r) for n in ("a", "b") for r in range(3)}
    runs = RunTable(synthetic_table({"a": 1.0, "b": 2.0}, repetitions=3, failures=lost))
    found = StudyEvidence(runs)
    (verdict,) = study_verdicts(found)
    assert verdict.evidence.measure.name == "finished"
    assert verdict.lead.startswith("Noise 30 s: no difference in success rate is shown")
    assert StudyReport(found, StudyFacts("x")).tables[-1].title == "Runs that ended early"


@pytest.mark.parametrize(
    ("share", "text"),
    [(1.0, "100 %"), (0.999, "99.90 %"), (0.5, "50 %"), (0.0, "0 %"), (0.001, "0.10 %")],
)
def test_only_exact_shares_are_0_and_100_percent(share, text):
    assert percent(share) == text


def test_tables_have_every_part(study):
    tables = {table.title: table for table in StudyReport(study, FACTS).tables}
    assert list(tables) == [
        "Verdict", "Claims of the paper", "Published values", "Tracking error without noise",
        "Tracking error with the paper's noise", "Distribution of ME", "Paired differences",
        "By mass", "By plant", "What matters", "Runs that ended early",
    ]  # fmt: skip
    distribution = tables["Distribution of ME"]
    pid = next(row for row in distribution.rows if row[1] == "pid")
    assert pid[-2:] == ("58 %", "48")
    ranks = {row[1]: row[2] for row in distribution.rows[:4]}
    assert ranks == {"fuzzy_t2": "1", "mine<script>": "1", "pid": "1", "fuzzy_t1": "4"}
    assert [row[2] for row in distribution.rows[:4]] == ["1", "1", "1", "4"]
    assert distribution.best
    assert [row[1] for row in tables["By mass"].rows] == ["50", "75"] * 2
    assert tables["By mass"].rows[0][3].endswith("(58 %)")
    assert tables["What matters"].rows[0][2] == "controller"
    assert tables["Runs that ended early"].rows[0] == (
        "pid", "noise 30 s", "controller failed", "20",
    )  # fmt: skip
    assert "step time, µs" in tables["Tracking error without noise"].columns
    effects = "".join(row[6] for row in tables["Paired differences"].rows)
    assert "-" not in effects
    assert "\N{MINUS SIGN}" in effects


def test_refused_runs_count_nowhere():
    table = synthetic_table({"a": 1.0, "b": 2.0}, repetitions=4, failures={("a", 1)})
    outcomes = ["refused" if not done else "finished" for done in table["finished"].to_pylist()]
    table = table.set_column(table.column_names.index("outcome"), "outcome", pa.array(outcomes))
    runs = RunTable(table)
    assert (len(runs), runs.refused, bool(runs.finished.all())) == (7, 1, True)


def test_pareto_front():
    points = [
        CostPoint(n, MeanEstimate(t, t, t, 9), MeanEstimate(e, e, e, 9))
        for n, t, e in (("a", 1.0, 5.0), ("b", 2.0, 6.0), ("c", 3.0, 2.0), ("d", 3.0, 3.0),
                        ("e", 9.0, 2.0))
    ]  # fmt: skip
    assert [p.controller for p in pareto_front(points)] == ["a", "c"]
    assert [p.controller for p in pareto_front(points, lower_is_better=False)] == ["a", "b"]


def test_figures_show_their_data(study):
    verdicts = study_verdicts(study)
    styles = FACTS.styles(study.runs.controllers)
    known = drawings(study, verdicts, styles)
    assert all(each.title and each.caption for each in known.values())
    found = {name: drawn(each) for name, each in known.items()}
    assert list(found) == [
        "distributions", "pairs", "cost", "shares", "heat_maps", "axis_1", "axis_2",
    ]  # fmt: skip
    assert all(isinstance(each, Figure) for each in found.values())
    first = found["distributions"].axes[0]
    names = [label.get_text() for label in first.get_yticklabels()]
    assert names == [s.controller for s in verdicts[0].evidence.ranking]
    line = found["axis_1"].axes[0].get_lines()[0]
    pid = [s.mean.mean for e in study.along("me", "mass")[verdicts[0].evidence.task]
           for s in e.evidence.summaries if s.controller == "pid"]  # fmt: skip
    assert line.get_ydata() == pytest.approx(1e3 * np.array(pid))
    image = found["heat_maps"].axes[0].get_images()[0]
    assert image.get_array().shape == (2, 2)
    shown = {p.controller for p in cost_points(study, verdicts[0])}
    assert shown == set(EFFECTS)


def page_of(study, facts):
    return page_text(StudyReport(study, facts), figures=[PageFigure("A", "b", b"<svg/>")])


def test_report_is_one_offline_file_with_everything(study):
    tables = StudyReport(study, FACTS).tables
    page = page_of(study, FACTS)
    assert "Which &lt;controller&gt; is best?" in page
    assert "mine<script>" not in page
    assert "name: &lt;b&gt;" in page
    assert "ab" * 32 in page
    assert "16 of 400 planned runs are not finished" in page
    assert "claims of the paper hold" in page
    assert page.count("<table") == len(tables)
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert "{{" not in page
    assert len(re.findall(r"<script>(.*?)</script>", page, re.DOTALL)) == 2
    policy = re.search(r'Policy" content="([^"]*)"', page)[1]
    assert policy.count("sha256-") == 2 + page.count("<style>")
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))


@pytest.mark.long
def test_report_has_every_figure_and_table(study, tmp_path):
    written = list(StudyReport(study, FACTS).write(tmp_path))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert written[-1] == tmp_path / "report.html"
    assert [p.suffix for p in written].count(".svg") == page.count("<img ") == 7
    assert [p.suffix for p in written].count(".csv") == page.count("<table")


@pytest.mark.long
def test_equal_studies_have_equal_reports(study, tmp_path):
    digests = []
    for name in ("a", "b"):
        fresh = StudyEvidence(study.runs)
        for path in StudyReport(fresh, FACTS).write(tmp_path / name):
            digests.append((path.name, sha256(path.read_bytes()).hexdigest()))
    half = len(digests) // 2
    assert digests[:half] == digests[half:]


def test_equal_runs_have_equal_tables(study):
    fresh = StudyEvidence(RunTable(study.runs.table))
    again = StudyEvidence(RunTable(study.runs.table))
    assert StudyReport(fresh, FACTS).tables == StudyReport(again, FACTS).tables


def test_sequential_study_says_so(study):
    facts = StudyFacts("x", until="me:0.1mm")
    sequential = StudyEvidence(study.runs, always_valid=True)
    verdicts = study_verdicts(sequential)
    assert paired_intervals(sequential, verdicts) is None  # too few repetitions
    page = page_of(sequential, facts)
    assert "always valid" in page
    assert "studentised" not in page


def test_notes_explain_intervals_only_where_there_are_some():
    assert "± half its 95 % interval" in interval_note([("a", "1.0 ± 0.2")])
    assert not interval_note([("a", "1.0")])


def test_note_says_why_shares_have_no_interval_and_random_factors_none():
    few = StudyEvidence(RunTable(synthetic_table({"a": 0.05, "b": 0.06}, repetitions=8)))
    table = tables_by_title(StudyReport(few, StudyFacts("x")))["What matters"]
    assert {row[-1] for row in table.rows} == {"–"}
    assert "Intervals and random factors need 10 repetitions." in table.note


def test_notes_name_the_repetitions_that_a_difference_needs():
    few, enough = (
        StudyReport(StudyEvidence(RunTable(synthetic_table(
            {"a": 0.05, "b": 0.06, "c": 0.07}, repetitions=count
        ))), StudyFacts("x")).tables[0].note
        for count in (3, 7)
    )  # fmt: skip
    assert "With 3 repetitions no difference between runs that vary can be shown at 5 %" in few
    assert "3 pairs of controllers need at least 7" in few
    assert "need at least" not in enough


def test_the_verdict_says_where_another_controller_is_best():
    """fuzzy_t2 is best on average and without noise, pid with the most noise."""

    def value(name, factors):
        return {"pid": -0.02, "fuzzy_t2": 0.0}[name] * (factors["noise"] == 3.0)

    axes = {"noise": [0.0, 1.0, 2.0, 3.0], "floor": ["dry", "wet"]}
    table = synthetic_table({"pid": 0.06, "fuzzy_t2": 0.05}, axes=axes, value=value)
    (verdict,) = study_verdicts(StudyEvidence(RunTable(table)))
    assert verdict.along == ("Along noise the best one differs: fuzzy_t2 at 0, 1 and 2; pid at 3.",)
    assert "fuzzy_t2 is best on average, ME" in verdict.lead
    assert verdict.along[0] in verdict.lead
    same = synthetic_table({"pid": 0.06, "fuzzy_t2": 0.05}, axes=axes)
    (plain,) = study_verdicts(StudyEvidence(RunTable(same)))
    assert plain.along == ()
    assert "on average" not in plain.lead


def test_the_verdict_compares_only_where_the_best_one_has_runs():
    """At the largest noise, pid is alone."""
    table = synthetic_table({"pid": 0.06, "fuzzy_t2": 0.05}, axes={"noise": [0.0, 1.0, 2.0]})
    runs = zip(table["controller"].to_pylist(), table["factor:noise"].to_pylist(), strict=True)
    kept = [(name, noise) != ("fuzzy_t2", 2.0) for name, noise in runs]
    (verdict,) = study_verdicts(StudyEvidence(RunTable(table.filter(pa.array(kept)))))
    assert verdict.evidence.best == ("fuzzy_t2",)
    assert verdict.along == ()


ODD = [
    "$$", "$x^2$", r"\frac{", "a_b%", "<b>bold</b>", "{}", "a\nb", "m&m", "\u202eabc", "\U0001f916",
    "x" * 40, "$", "^{",
]  # fmt: skip


@pytest.mark.filterwarnings("ignore:Glyph")
@pytest.mark.parametrize("labels", [ODD[::3], ODD[1::3], ODD[2::3]])
def test_labels_are_shown_literally(labels, tmp_path):
    """In figures, on the page and in tables, as names of controllers and values of axes."""
    table = synthetic_table(
        {label: 0.05 + 0.01 * k for k, label in enumerate(labels)},
        repetitions=8,
        axes={"floor": labels},
    )
    study = StudyEvidence(RunTable(table))
    report = StudyReport(study, FACTS)
    found = []
    for figure in filter(None, map(drawn, report.figures.values())):
        texts = [t for t in figure.findobj(Text) if any(each in t.get_text() for each in labels)]
        assert not any(text.get_parse_math() for text in texts)
        found += texts
        with figure_style():
            figure.savefig(tmp_path / "figure.png", dpi=30)
    assert {each for each in labels for text in found if each in text.get_text()} == set(labels)
    page = page_of(study, FACTS)
    assert "<b>bold" not in page
    for label in labels:
        assert escape(label) in page or escape(one_line(label)) in page


def test_axis_values_at_which_no_run_is_finished_are_stated():
    table = synthetic_table(EFFECTS, repetitions=8, axes={"friction": [0.2, 1.0]}, own=3e-4)
    lost = pa.compute.equal(table["factor:friction"], 0.2)
    for name, value in (("outcome", "stopped"), ("finished", False)):
        column = pa.compute.if_else(lost, pa.scalar(value), table[name])
        table = table.set_column(table.column_names.index(name), name, column)
    study = StudyEvidence(RunTable(table))
    (verdict,) = study_verdicts(study)
    assert "Along friction no run is finished at 0.2." in verdict.lead
    rows = tables_by_title(StudyReport(study, StudyFacts("x")))["By friction"].rows
    assert [row[1] for row in rows] == ["0.2", "1"]
    assert set(rows[0][3:-1]) == {"– (0 %)"}
    assert axis_curves(study, [verdict], {}, "friction") is None  # one point is no curve


def test_many_axis_values_without_a_finished_run_are_counted():
    levels = [0.1, 0.2, 0.3, 0.4, 0.5, 1.0]
    table = synthetic_table(EFFECTS, repetitions=3, axes={"friction": levels}, own=3e-4)
    lost = pa.compute.less(table["factor:friction"], 0.9)
    for name, value in (("outcome", "stopped"), ("finished", False)):
        column = pa.compute.if_else(lost, pa.scalar(value), table[name])
        table = table.set_column(table.column_names.index(name), name, column)
    (verdict,) = study_verdicts(StudyEvidence(RunTable(table)))
    assert verdict.lost == ("Along friction no run is finished at 5 values from 0.1 to 0.5.",)
