"""Verdicts: best controller, factor, confidence, work and computing time of each task."""

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.control.supervision import Event
from omnidrive.evaluation.page.markup import verdict_markup
from omnidrive.evaluation.study_logs import RecordedRun
from omnidrive.evaluation.verdict import headline
from omnidrive.simulation import Outcome
from omnidrive.simulation.disturbances import parse_fault
from tests.evaluation.recorded import (
    ended,
    labelled,
    record,
    reported,
    tables_by_title,
    with_metrics,
)
from tests.evaluation.truncation import truncated

SEEDS = 12
RNG = np.random.default_rng(5)
NOISE = RNG.normal(size=SEEDS)
RATIO = np.exp(0.2 + 0.05 * RNG.normal(size=SEEDS))


def with_me(run, me, **labels):
    return labelled(with_metrics(run, me=me, work=10.0), **labels)


def verdict_of(logs, records=None, **facts):
    """Return the only verdict of logs."""
    (verdict,) = reported(logs, records, **facts).verdicts
    return verdict


def markup(report):
    return verdict_markup(report.verdicts, report.tables[0].lead)


def test_every_task_has_a_verdict(study):
    found = reported(study).verdicts
    assert [v.name for v in found] == [
        "track 20 s", "track 30 s", "noise 30 s", "step response", "N of unicycle-nmpc",
    ]  # fmt: skip
    for verdict in found:
        values = [contender.mean.mean for contender in verdict.ranking]
        assert values == sorted(values)
    track = {r.controller: r.record for r in study.select("track", duration=20.0)}
    errors = {name: each.metrics["me"] for name, each in track.items()}
    best = min(errors, key=errors.get)
    assert found[0].best == (best,)
    ordered = sorted(errors.values())
    assert found[0].factor == pytest.approx(ordered[1] / ordered[0])
    assert found[0].confidence == "one run: no interval"
    assert found[0].costs[best].step_time == track[best].timing["step_time_median"]


def test_first_table_is_the_verdict(study):
    report = reported(study)
    table, best = report.tables[0], report.verdicts[0]
    assert table.title == "Verdict"
    cells = dict(zip(table.columns, table.rows[0], strict=True))
    assert (cells["task"], cells["best"]) == ("track 20 s", best.leader.controller)
    assert cells["result"] == f"ME {1e3 * best.leader.mean.mean:.3g} mm"
    assert table.lead == headline(report.verdicts)
    name = best.leader.controller
    assert f"Best in track 20 s, track 30 s and step response: {name}." in table.lead


def test_limits_that_a_reference_exceeds_are_one_sentence_with_labels(study):
    """And those of the shortest, fastest reference only."""

    def exceeding(run):
        text = f"the reference moves at up to {30.0 / run.duration:g} m/s{FALLS_BEHIND}"
        events = (Event(0.0, text),) if run.controller.startswith("fuzzy") else ()
        return run._replace(log=replace(run.log, events=events))

    assert study.limit_notes == []
    fast = replace(study, runs=tuple(map(exceeding, study.select("track"))))
    sentence = (
        "In 20 s, the reference moves at up to 1.5 m/s: the robot falls behind "
        "(fuzzy_t1, fuzzy_t2)."
    )
    assert fast.limit_notes == [sentence]
    assert reported(fast).tables[0].lead.endswith(sentence)
    assert markup(reported(fast)).count(sentence) == 1


def test_verdict_states_advantage_confidence_work_and_computing_time(part):
    first, second = part.runs
    better = with_metrics(first, me=0.01, work=10.0, step_time_median=50.0)
    worse = with_metrics(second, me=0.02, work=12.0, step_time_median=80.0)
    report = reported(replace(part, runs=(better, worse)))
    table, name = report.tables[0], second.controller
    assert dict(zip(table.columns, table.rows[0], strict=True)) == {
        "task": "track 20 s", "best": first.controller, "result": "ME 10.0 mm",
        "next": name, "result of next": "ME 20.0 mm",
        "factor": "2.00", "confidence": "one run: no interval",
        "work, J": "10.0", "work of next, J": "12.0",
        "step time, µs": "50.0", "step time of next, µs": "80.0",
    }  # fmt: skip
    advantage, cost = f"2.00 times lower than {name} (ME 20.0 mm)", "10.0 J, 50.0 µs per step"
    parts = ("ME 10.0 mm", advantage, "one run: no interval", cost)
    assert table.compact.rows[0][2] == f"{'; '.join(parts)} (next: 12.0 J, 80.0 µs per step)"
    assert "".join(f"<span>{text}</span>" for text in parts) in markup(report)


def test_one_run_with_noise_is_no_proof(study):
    report = reported(study)
    (noise,) = (v for v in report.verdicts if v.evidence.task.name == "noise")
    text = f"Noise 30 s: {noise.best[0]} is best in one run; check with --noise-seeds 20"
    assert text in headline([noise])
    assert '<span class="option">--noise-seeds 20</span> or' in markup(report)


@pytest.fixture
def repeated(study):
    """Records with noise of three controllers; a is worse than b by ``RATIO`` in every seed."""
    some = study.select("noise")[0]
    me = {"b": 0.05 + 0.01 * np.abs(NOISE)}
    me["a"], me["c"] = me["b"] * RATIO, me["b"] + 1e-4 * RNG.normal(size=SEEDS) + 1e-6
    records = [
        with_me(some, values[k], controller=name, repeat=k).record
        for k in range(SEEDS)
        for name, values in me.items()
    ]
    return replace(study, runs=(some,), repeats=SEEDS), records


def of_controllers(records, names, seeds=SEEDS):
    return [each for each in records if each.controller in names and each.repeat < seeds]


def test_difference_over_seeds_has_an_interval(repeated):
    logs, records = repeated
    verdict = verdict_of(logs, of_controllers(records, "ab"))
    assert [each.controller for each in verdict.ranking] == ["b", "a"]
    means = [np.mean([r.metrics["me"] for r in records if r.controller == n]) for n in "ab"]
    assert verdict.factor == pytest.approx(means[0] / means[1])
    pair = verdict.evidence.pair("b", "a")
    assert pair.p == 2.0 / 2.0**SEEDS  # each seed has the same sign
    assert verdict.confidence.startswith("b is better than a by ")
    assert "p < 0.001" in verdict.confidence
    assert headline([verdict]).startswith("Noise 30 s: b is best, ME ")


def test_tie_is_no_win(repeated):
    verdict = verdict_of(*repeated)
    assert verdict.best == ("c", "b")
    assert verdict.confidence.startswith("no difference shown between c and b")
    assert "no difference in ME is shown between c" in headline([verdict])


@pytest.mark.parametrize(
    ("seeds", "names", "needed"), [(5, "ab", 6), (6, "ab", 0), (6, "abc", 7), (7, "abc", 0)]
)
def test_tie_of_too_few_seeds_states_how_many_are_needed(repeated, seeds, names, needed):
    logs, records = repeated
    worse = {"a": 0.2, "c": 0.1}
    some = [
        replace(each, metrics={**each.metrics, "me": worse[each.controller] + 0.01 * each.repeat})
        if each.controller in worse
        else each
        for each in of_controllers(records, names, seeds)
    ]
    report = reported(logs, some)
    assert (len(report.verdicts[0].best) > 1) == bool(needed)
    note = report.tables[0].note
    assert (f"at least {needed}." in note) == bool(needed)


def test_runs_within_one_percent_are_equal(part):
    first, second = part.runs
    verdict = verdict_of(replace(part, runs=(with_me(first, 0.01), with_me(second, 0.010099))))
    assert verdict.confidence == "equal within 1 %"
    a, b = first.controller, second.controller
    assert headline([verdict]) == f"Track 20 s: {a} and {b} are equal within 1 %."
    verdict = verdict_of(replace(part, runs=(with_me(first, 0.01), with_me(second, 0.010101))))
    assert headline([verdict]) == f"Best in track 20 s: {a}."


@pytest.mark.parametrize(
    ("values", "tied"), [((5e-8, 2e-7), True), ((5e-7, 1e-6), False), ((1e-6, 2e-6), False)]
)
def test_results_that_are_equal_in_tables_are_equal_in_the_verdict(part, values, tied):
    pair = tuple(with_me(r, me) for r, me in zip(part.runs, values, strict=True))
    report = reported(replace(part, runs=pair))
    (verdict,) = report.verdicts
    table = tables_by_title(report)["Tracking error without noise"]
    column = table.columns.index("ME, mm")
    assert (not any(i == column for _, i in table.best)) == (len(verdict.best) > 1) == tied
    a, b = (r.controller for r in pair)
    if tied:
        assert headline([verdict]) == f"Track 20 s: {a} and {b} are both below 0.001 mm."
        assert verdict.confidence == "both below 0.001 mm"
        assert verdict.value_text(verdict.leader) == "ME < 0.001 mm"
    else:
        assert headline([verdict]) == f"Best in track 20 s: {a}."


def test_negligible_errors_over_seeds_show_no_difference(repeated):
    logs, records = repeated
    small = [
        replace(r, metrics={**r.metrics, "me": (1e-10 if r.controller == "a" else 3e-10)})
        for r in of_controllers(records, "ab")
    ]
    verdict = verdict_of(logs, small)
    assert set(verdict.best) == {"a", "b"}


def test_run_without_error_has_no_factor(part):
    first, second = part.runs
    report = reported(replace(part, runs=(with_me(first, 0.01), with_me(second, 0.0))))
    (verdict,) = report.verdicts
    assert (verdict.best, verdict.factor_text) == ((second.controller,), "–")
    assert f"next: {first.controller} (ME 10.0 mm)" in markup(report)
    rounding = (with_me(first, 1e-15), with_me(second, 3e-15))
    assert len(verdict_of(replace(part, runs=rounding)).best) == 2


def test_stopped_run_is_not_ranked(part):
    first, second = part.runs
    stopped = ended(first, truncated(first.log, 60, outcome=Outcome.CONTROLLER_FAILED))
    report = reported(replace(part, runs=(stopped, second)))
    (verdict,) = report.verdicts
    assert (verdict.best, verdict.unranked) == ((second.controller,), (first.controller,))
    assert (verdict.following, verdict.confidence) == (None, "no other result")
    table, errors = report.tables[:2]
    assert f"{first.controller} (track 20 s)" in table.note
    assert errors.rows[0][1] == f"{first.controller} (stopped at 5.9 s)"
    shown = dict(zip(errors.columns, errors.rows[0], strict=True))
    assert {shown[name] for name in ("ME, mm", "MAE, mrad", "max. error, mm")} == {"–"}
    (none,) = reported(replace(part, runs=(stopped, stopped))).verdicts
    assert none.evidence.measure.name == "finished"


def test_path_decides_if_a_controller_is_late_on_purpose(part):
    first, second = part.runs
    late = replace(first.log, details={"reference_delay": 0.1 * (first.log.t > 3.0)})
    runs = (
        with_metrics(first, late, me=0.3, path_me=0.001),
        with_metrics(second, me=0.1, path_me=0.05),
    )
    report = reported(replace(part, runs=runs))
    (verdict,) = report.verdicts
    assert (verdict.evidence.measure.name, verdict.best) == ("path_me", (first.controller,))
    table, errors = report.tables[:2]
    assert "path ME 1.00 mm" in table.rows[0]
    assert "Path ME" in table.note
    assert {"path ME, mm", "path MAE, mrad", "arrival, s"} <= set(errors.columns)
    punctual = reported(replace(part, runs=(runs[0]._replace(log=first.log), runs[1])))
    (verdict,) = punctual.verdicts
    assert (verdict.evidence.measure.name, verdict.best) == ("me", (second.controller,))
    assert "path ME, mm" not in punctual.tables[1].columns


def test_one_controller_has_no_table_of_the_verdict(part):
    report = reported(replace(part, runs=part.runs[:1]))
    assert "Verdict" not in tables_by_title(report)


def test_step_response_is_ranked_by_its_slowest_axis(study):
    log = study.select("step")[0].log

    def step(name, *times):
        values = {}
        for axis, seconds in zip(("x", "y"), times, strict=True):
            values |= {f"overshoot_{axis}": 0.0, f"settling_time_{axis}": seconds}
        undefined = {"overshoot_heading": nan, "settling_time_heading": nan}  # without a step
        return RecordedRun(record("step", name, {**values, **undefined, "work": 1.0}), log)

    runs = (step("a", 1.0, 0.2), step("b", 0.9, 0.8), step("c", 0.1, nan))
    verdict = verdict_of(replace(study, runs=runs))
    assert [c.controller for c in verdict.ranking] == ["b", "a"]
    assert verdict.unranked == ("c",)
    assert verdict.value_text(verdict.leader) == "settling time 0.900 s"
    assert verdict.factor_text == "1.11"


def test_faults_are_ranked_by_recoveries_then_by_error(part):
    log = part.runs[0].log
    fault = parse_fault("encoder-dead:wheel=1,at=4")

    def runs(name, *recovered):
        made = [record("faults", name, {"me": 0.01}, variant="00-none")]
        made += [
            record("faults", name, {"me": 0.01, "recovered": float(each), "worst_error": 0.1 * k,
                                    "time_to_recover": 1.0}, variant=f"{k:02d}-encoder-dead")
            for k, each in enumerate(recovered, 1)
        ]  # fmt: skip
        return [RecordedRun(each, log) for each in made]

    every = (*runs("frail", False, True), *runs("robust", True, True))
    faults = {f"{k:02d}-encoder-dead": fault for k in (1, 2)}
    verdict = verdict_of(replace(part, runs=every, faults=faults))
    assert [c.controller for c in verdict.ranking] == ["robust", "frail"]
    assert verdict.recovered == {"robust": 2, "frail": 1}
    assert verdict.factor_text == "1 more"
    text = "recovered from 2 of 2 faults, worst error 200 mm"
    assert verdict.value_text(verdict.leader) == text
    assert headline([verdict]) == "Best in faults 20 s: robust."


def test_horizons_are_the_contenders_of_their_task(study):
    (swept,) = (v for v in reported(study).verdicts if v.swept)
    assert swept.swept == "unicycle-nmpc"
    errors = {r.record.variant: r.record.metrics["me"] for r in study.select("horizon")}
    assert swept.best[0] == min(errors, key=errors.get)
    assert headline([swept]) == f"Best N of unicycle-nmpc: {swept.best[0]}."
    assert len(swept.ranking) == len(errors)
