"""Verdicts: best controller, factor, confidence, work and computing time of each task."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.control.supervision import Event
from omnidrive.evaluation import FaultResult, StepResponse, headline, study_tables, verdicts
from omnidrive.evaluation.page.markup import verdict_markup
from omnidrive.evaluation.verdict import limit_notes
from omnidrive.simulation import Outcome
from omnidrive.simulation.disturbances import parse_fault
from tests.evaluation.truncation import truncated

SEEDS = 12
RNG = np.random.default_rng(5)
NOISE = RNG.normal(size=SEEDS)
RATIO = np.exp(0.2 + 0.05 * RNG.normal(size=SEEDS))


def with_me(result, me, **changes):
    return replace(result, metrics=result.metrics._replace(me=me, work=10.0), **changes)


def of_task(results, task):
    return [verdict for verdict in verdicts(results) if verdict.task == task]


def test_every_task_has_a_verdict(study):
    found = verdicts(study)
    assert [v.name for v in found] == [
        "track 20 s", "track 30 s", "noise 30 s", "step response", "N of unicycle-nmpc",
    ]  # fmt: skip
    for verdict in found:
        values = [contender.value for contender in verdict.ranking]
        assert values == sorted(values)
    track = {r.controller: r.metrics.me for r in study.select("track", duration=20.0)}
    assert found[0].best.name == min(track, key=track.get)
    ordered = sorted(track.values())
    assert found[0].advantage.factor == pytest.approx(ordered[1] / ordered[0])
    assert found[0].confidence_text == "one run: no interval"
    times = {r.controller: np.nanmedian(r.run.step_time) for r in study.select("track")[:4]}
    assert found[0].best.step_time == pytest.approx(times[found[0].best.name])


def test_first_table_is_the_verdict(study):
    table = study_tables(study, published=False)[0]
    assert table.title == "Verdict"
    cells = dict(zip(table.columns, table.rows[0], strict=True))
    best = verdicts(study)[0]
    assert (cells["task"], cells["best"]) == ("track 20 s", best.best.name)
    assert cells["result"] == f"ME {1e3 * best.best.value:.3g} mm"
    assert table.lead == " ".join(headline(verdicts(study)))
    assert f"Best in track 20 s, track 30 s and step response: {best.best.name}." in table.lead


def test_limits_that_a_reference_exceeds_are_one_sentence_with_labels(study):
    """And those of the shortest, fastest reference only."""

    def exceeding(result):
        text = f"the reference moves at up to {30.0 / result.duration:g} m/s{FALLS_BEHIND}"
        events = (Event(0.0, text),) if result.controller.startswith("fuzzy") else ()
        return replace(result, run=replace(result.run, events=events))

    assert limit_notes(study) == []
    tracks = tuple(map(exceeding, study.tracks))
    fast = replace(study, tracks=tracks)
    sentence = (
        "In 20 s, the reference moves at up to 1.5 m/s: the robot falls behind "
        "(fuzzy_t1, fuzzy_t2)."
    )
    assert limit_notes(fast) == [sentence]
    assert study_tables(fast, published=False)[0].lead.endswith(sentence)
    assert verdict_markup(fast).count(sentence) == 1


def test_verdict_states_advantage_confidence_work_and_computing_time(part):
    first, second = part.tracks
    better = first.metrics._replace(me=0.01, work=10.0, step_time_median=50.0)
    worse = second.metrics._replace(me=0.02, work=12.0, step_time_median=80.0)
    results = replace(part, tracks=(replace(first, metrics=better), replace(second, metrics=worse)))
    table = study_tables(results, published=False)[0]
    name = second.controller
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
    assert "".join(f"<span>{text}</span>" for text in parts) in verdict_markup(results)


def test_one_run_with_noise_is_no_proof(study):
    (noise,) = of_task(study, "noise")
    assert f"Noise 30 s: {noise.best.name} is best in one run" in " ".join(headline([noise]))
    assert '<span class="option">--noise-seeds 20</span>.' in verdict_markup(study)


@pytest.fixture
def repeated(study):
    """Noise runs of three controllers; the first two differ by ``RATIO`` in every seed."""
    some = study.select("noise")[0]
    me = {"b": 0.05 + 0.01 * np.abs(NOISE)}
    me["a"], me["c"] = me["b"] * RATIO, me["b"] + 1e-4 * RNG.normal(size=SEEDS) + 1e-6
    runs = [
        with_me(some, values[k], controller=name, repeat=k)
        for k in range(SEEDS)
        for name, values in me.items()
    ]
    return replace(study, tracks=tuple(runs), steps=())


def test_factor_over_seeds_has_an_interval(repeated):
    two = replace(repeated, tracks=tuple(r for r in repeated.tracks if r.controller != "c"))
    (verdict,) = verdicts(two)
    assert (verdict.best.name, verdict.following.name) == ("b", "a")
    low, high = np.exp(stats.t.interval(0.95, SEEDS - 1, np.mean(np.log(RATIO)),
                                        stats.sem(np.log(RATIO))))  # fmt: skip
    assert verdict.advantage[:3] == pytest.approx((stats.gmean(RATIO), low, high))
    assert verdict.advantage.p == 2.0 / 2.0**SEEDS  # each seed has the same sign
    assert verdict.confidence_text == f"{low:.2f} to {high:.2f}, p < 0.001"
    assert headline([verdict]) == ["Best in noise 30 s: b."]


def test_tie_is_no_win(repeated):
    (verdict,) = verdicts(repeated)
    assert verdict.advantage.is_tied
    assert verdict.confidence_text.startswith("no difference shown, p = ")
    assert headline([verdict]) == ["Noise 30 s: no difference shown between c and b."]


@pytest.mark.parametrize(
    ("seeds", "names", "needed"), [(5, "ab", 6), (6, "ab", 0), (6, "abc", 7), (7, "abc", 0)]
)
def test_tie_of_too_few_seeds_states_how_many_are_needed(repeated, seeds, names, needed):
    some = [r for r in repeated.tracks if r.repeat < seeds and r.controller in names]
    larger = [with_me(r, 0.2 + 0.01 * r.repeat) if r.controller == "a" else r for r in some]
    equal = [with_me(r, 0.1 + 0.01 * r.repeat) if r.controller == "c" else r for r in larger]
    (verdict,) = verdicts(replace(repeated, tracks=tuple(equal)))
    (sentence,) = headline([verdict])
    assert verdict.advantage.is_tied == bool(needed)
    assert (f"at least {needed} are needed; check with --noise-seeds 20" in sentence) == bool(
        needed
    )
    text = f"({seeds} seeds, at least {needed} needed)"
    assert verdict.confidence_text.endswith(text) == bool(needed)


def test_runs_within_one_percent_are_equal(part):
    first, second = part.tracks
    pair = (with_me(first, 0.01), with_me(second, 0.010099))
    (verdict,) = verdicts(replace(part, tracks=pair))
    assert verdict.confidence_text == "equal within 1 %"
    a, b = first.controller, second.controller
    assert headline([verdict]) == [f"Track 20 s: {a} and {b} are equal within 1 %."]
    (verdict,) = verdicts(replace(part, tracks=(pair[0], with_me(second, 0.010101))))
    assert headline([verdict]) == [f"Best in track 20 s: {a}."]


@pytest.mark.parametrize(
    ("values", "tied"), [((5e-8, 2e-7), True), ((5e-7, 1e-6), False), ((1e-6, 2e-6), False)]
)
def test_results_that_are_equal_in_tables_are_equal_in_the_verdict(part, values, tied):
    pair = tuple(with_me(r, me) for r, me in zip(part.tracks, values, strict=True))
    results = replace(part, tracks=pair)
    (verdict,) = verdicts(results)
    table = next(t for t in study_tables(results, published=False) if "ME, mm" in t.columns)
    column = table.columns.index("ME, mm")
    assert (not any(i == column for _, i in table.best)) == verdict.advantage.is_tied == tied
    a, b = (r.controller for r in pair)
    if tied:
        assert headline([verdict]) == [f"Track 20 s: {a} and {b} are both below 0.001 mm."]
        assert verdict.confidence_text == "both below 0.001 mm"
        assert verdict.value_text(verdict.best) == "ME < 0.001 mm"
    else:
        assert headline([verdict]) == [f"Best in track 20 s: {a}."]


def test_negligible_errors_over_seeds_show_no_difference(repeated):
    small = tuple(
        with_me(r, (1e-7 if r.controller == "a" else 3e-7) + 1e-9 * r.repeat)
        for r in repeated.tracks
    )
    (verdict,) = verdicts(replace(repeated, tracks=small))
    assert verdict.advantage.is_tied
    assert "no difference shown between a and b" in headline([verdict])[0]


def test_run_without_error_has_no_factor(part, repeated):
    first, second = part.tracks
    (verdict,) = verdicts(replace(part, tracks=(with_me(first, 0.01), with_me(second, 0.0))))
    assert (verdict.best.name, verdict.factor_text) == (second.controller, "–")
    assert f"next: {first.controller} (ME 10.0 mm)" in verdict_markup(replace(part, tracks=(
        with_me(first, 0.01), with_me(second, 0.0))))  # fmt: skip
    rounding = (with_me(first, 1e-15), with_me(second, 3e-15))
    (verdict,) = verdicts(replace(part, tracks=rounding))
    assert verdict.advantage.is_tied
    exact = tuple(with_me(r, 0.0) if r.controller == "b" else r for r in repeated.tracks)
    (verdict,) = verdicts(replace(repeated, tracks=exact))
    assert (verdict.best.name, verdict.factor_text) == ("b", "–")


def test_stopped_run_is_not_ranked(part):
    first, second = part.tracks
    stopped = replace(first, run=truncated(first.run, 60, outcome=Outcome.CONTROLLER_FAILED))
    (verdict,) = verdicts(replace(part, tracks=(stopped, second)))
    assert (verdict.best.name, verdict.unranked) == (second.controller, (first.controller,))
    assert (verdict.following, verdict.confidence_text) == (None, "no other result")
    tables = study_tables(replace(part, tracks=(stopped, second)), published=False)
    verdict_table, errors = tables[:2]
    assert f"{first.controller} (track 20 s)" in verdict_table.note
    assert errors.rows[0][1] == f"{first.controller} (stopped at 5.9 s)"
    assert set(errors.rows[0][2:]) <= {"–", ""}
    assert verdicts(replace(part, tracks=(stopped, stopped))) == []


def test_path_decides_if_a_controller_is_late_on_purpose(part):
    first, second = part.tracks
    late = replace(first.run, details={"reference_delay": 0.1 * (first.run.t > 3.0)})
    tracks = tuple(
        replace(r, run=run, metrics=r.metrics._replace(me=me, path_me=path_me))
        for r, run, me, path_me in ((first, late, 0.3, 0.001), (second, second.run, 0.1, 0.05))
    )
    (verdict,) = verdicts(replace(part, tracks=tracks))
    assert (verdict.measure, verdict.best.name) == ("path_me", first.controller)
    table, errors = study_tables(replace(part, tracks=tracks), published=False)[:2]
    assert "path ME 1.00 mm" in table.rows[0]
    assert "Path ME" in table.note
    assert {"path ME, mm", "path MAE, mrad", "arrival, s"} <= set(errors.columns)
    punctual = (replace(tracks[0], run=first.run), tracks[1])
    (verdict,) = verdicts(replace(part, tracks=punctual))
    assert (verdict.measure, verdict.best.name) == ("me", second.controller)
    errors = study_tables(replace(part, tracks=punctual), published=False)[1]
    assert "path ME, mm" not in errors.columns


def test_one_controller_has_no_verdict(part):
    assert verdicts(replace(part, tracks=part.tracks[:1])) == []


def test_step_response_is_ranked_by_its_slowest_axis(study):
    some = study.steps[0]
    undefined = StepResponse(float("nan"), float("nan"), float("nan"))  # an axis without a step

    def step(name, *times):
        responses = tuple(StepResponse(0.0, 0.1, seconds) for seconds in times)
        return replace(some, controller=name, responses=(*responses, undefined))

    steps = (step("a", 1.0, 0.2), step("b", 0.9, 0.8), step("c", 0.1, float("nan")))
    (verdict,) = verdicts(replace(study, tracks=(), steps=steps))
    assert [c.name for c in verdict.ranking] == ["b", "a"]
    assert verdict.unranked == ("c",)
    assert verdict.value_text(verdict.best) == "settling 0.900 s"
    assert verdict.factor_text == "1.11"


def test_faults_are_ranked_by_recoveries_then_by_error(part):
    result = part.tracks[0]
    fault = parse_fault("encoder-dead:wheel=1,at=4")
    stopped = truncated(
        result.run, 60, outcome=Outcome.STOPPED, events=(Event(4.5, "the watchdog stops"),)
    )

    def runs(name, *made):
        first = FaultResult(name, 0, None, 20.0, result.run, result.metrics)
        return [first, *(FaultResult(name, k, fault, 20.0, run, result.metrics)
                         for k, run in enumerate(made, 1))]  # fmt: skip

    faults = (*runs("frail", stopped, result.run), *runs("robust", result.run, result.run))
    (verdict,) = verdicts(replace(part, tracks=(), faults=faults))
    assert [c.name for c in verdict.ranking] == ["robust", "frail"]
    assert [c.recovered for c in verdict.ranking] == [2, 1]
    assert verdict.factor_text == "1 more"
    assert verdict.value_text(verdict.best).startswith("2 of 2 faults, max. error ")
    assert headline([verdict]) == ["Best in faults: robust."]
