"""Report, export and difference of stored studies, also by their verbs."""

import csv
import json
import os
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from typer.testing import CliRunner

from omnidrive.cli.main import app
from omnidrive.errors import InvalidInput, InvalidStore, OmnidriveError
from omnidrive.evaluation import RunRecord
from omnidrive.evaluation.figures.catalogue import write_figures
from omnidrive.files.output_file import _COMPUTER
from omnidrive.study import RunPlan, parse_definition, run_study, save_definition
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.run_export import results_digest
from omnidrive.study.setup_facts import setup_facts
from omnidrive.study.storage.store import Store
from omnidrive.study.stored_study import (
    compare_studies,
    export_study,
    read_study,
    report_study,
)
from tests.study.small import small_scenario

DEFINITION = {
    "format": "omnidrive-study-1",
    "name": "sampling",
    "question": "Does a shorter sample time help?",
    "scenario": {
        "robot": {"name": "paper"},
        "plant": "kinematic",
        "reference": {"type": "circle", "radius": 1.0},
        "controllers": {"pid": "pid", "stiff": {"type": "feedforward", "position": 9.0}},
        "tasks": {"noise": {"durations": [8.0]}},
    },
    "axes": {"sample_time": [0.05, 0.1]},
    "random": {"factors": {"reference.radius": {"low": 1.0, "high": 2.0}}},
    "repetitions": 12,
}


def made(folder, *, better=0.0, stored=None, changes=None):
    """Write a study whose errors are 50 mm and 40 mm, in whole or in part; return its folder."""
    folder.mkdir()
    definition = parse_definition({**DEFINITION, **(changes or {})}, "test")
    save_definition(definition, folder / "study.yaml")
    plan = RunPlan(definition)
    with Store(folder) as store:
        store.begin("hash")
        store.add([_record(run, better) for run in plan[: stored or len(plan)]])
    return folder


def _record(run, better):
    own = int(run.key[:6], 16) / 16**6
    error = 0.05 + 1e-3 * own - (0.01 + better if run.settings.controller == "stiff" else 0.0)
    empty = RunRecord(-1, run.key, -1, "", "", 0, {}, "finished", True,
                      {"me": error, "mae": 0.1 + own, "arrival": float("nan")},
                      {"step_time_median": 5.0 + own})  # fmt: skip
    return relabelled(empty, run)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return made(tmp_path_factory.mktemp("first") / "study")


@pytest.fixture(scope="module")
def second(tmp_path_factory):
    """The same study with a controller that is better by 1 mm."""
    return made(tmp_path_factory.mktemp("second") / "study", better=1e-3)


@pytest.fixture
def _with_figures(monkeypatch):
    monkeypatch.setattr("omnidrive.evaluation.study_report.write_figures", write_figures)


def verb(*arguments):
    return CliRunner().invoke(app, ["study", *map(str, arguments)])


def test_facts_state_what_was_done(first):
    study = read_study(first)
    facts = study.facts
    assert facts.question == "Does a shorter sample time help?"
    assert facts.planned == len(study.table) == 48
    assert facts.setup["Axis sample_time"] == "0.05, 0.1"
    assert facts.setup["Random reference.radius"] == "1 to 2"
    assert "Sample time" not in facts.setup  # that of the base scenario is not used
    assert facts.setup["Controllers"] == "pid; stiff: feedforward (position = 9.0)"
    assert facts.setup["Repetitions"] == "12, seed 1"
    assert facts.command == "omnidrive study study.yaml --out repeated"
    assert yaml.safe_load(facts.definition)["axes"] == {"sample_time": [0.05, 0.1]}
    assert not facts.published
    assert study.evidence.runs.axes == ("sample_time",)
    assert study.evidence.runs.random_factors == ("reference.radius",)


def test_versions_are_stated_only_if_the_keys_are_theirs(first):
    study = read_study(first)
    assert study.facts.versions["omnidrive"] == version("omnidrive")
    keys = ["0" * 64, *study.table["key"].to_pylist()[1:]]
    other = replace(study, table=study.table.set_column(1, "key", pa.array(keys)))
    assert list(other.facts.versions) == ["Versions"]


def test_hash_of_the_results_is_that_of_the_exported_file(first, second, tmp_path):
    study = read_study(first)
    export_study(study, tmp_path / "runs.csv")
    digest = sha256((tmp_path / "runs.csv").read_bytes()).hexdigest()
    hashes = study.facts.hashes
    assert results_digest(study.table) == hashes["Results"] == digest
    other = read_study(second).facts.hashes
    assert other.keys() == hashes.keys()
    assert [other[name] == hashes[name] for name in hashes] == [True, True, False]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_equal_studies_export_equal_bytes(first, tmp_path, suffix):
    contents = []
    for name, folder in (("a", first), ("b", made(tmp_path / "study"))):
        export_study(read_study(folder), tmp_path / f"{name}{suffix}")
        contents.append((tmp_path / f"{name}{suffix}").read_bytes())
    assert contents[0] == contents[1]


def test_exported_table_has_exact_numbers_and_times_on_demand(first, tmp_path):
    study = read_study(first)
    export_study(study, tmp_path / "runs.csv")
    with (tmp_path / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["number"]) for row in rows] == list(range(48))
    assert [float(row["me"]) for row in rows] == study.table["me"].to_pylist()
    assert {row["arrival"] for row in rows} == {""}
    assert "timing:step_time_median" not in rows[0]
    export_study(study, tmp_path / "runs.parquet", timing=True)
    table = pq.read_table(tmp_path / "runs.parquet")
    assert table["number"].to_pylist() == list(range(48))
    assert (
        table["timing:step_time_median"].to_pylist()
        == study.step_times["step_time_median"].to_pylist()
    )
    with pytest.raises(InvalidInput, match=r"the suffix of an exported table is \.csv or"):
        export_study(study, tmp_path / "runs.xlsx")


def test_difference_of_a_better_controller(first, second):
    found = compare_studies(read_study(first), read_study(second))
    assert found.matched == found.same_key == 48
    assert len(found.not_reproduced) == 24
    changed = {c.controller: c for c in found.changes if c.measure.name == "me"}
    assert (changed["pid"].verdict, changed["stiff"].verdict) == ("equal", "better")


def test_sequential_study_has_always_valid_intervals(tmp_path):
    folder = made(tmp_path / "a")
    with Store(folder) as store:
        store.note("until", "me:0.1mm")
    study = read_study(folder)
    assert study.evidence.always_valid
    assert study.facts.command.startswith("omnidrive study study.yaml --until me:0.1mm")


def test_comparison_is_read_and_reported_as_it_was_computed(tmp_path):
    computed = run_study(small_scenario(controllers=("feedforward", "pid")), tmp_path)
    study = read_study(tmp_path)
    assert study.definition.is_one_scenario
    assert study.facts.command == "omnidrive compare scenario.yaml --out repeated"
    assert results_digest(study.table) == results_digest(computed.table)
    assert [each.name for each in study.logs.runs] == [each.name for each in computed.logs.runs]
    written = {name: (tmp_path / name).read_bytes() for name in ("report.html", "results.json")}
    for name in written:
        (tmp_path / name).unlink()
    page, tables = report_study(study)
    assert page == tmp_path / "report.html"
    assert page.read_bytes() == written["report.html"]
    assert [table.title for table in tables] == [table.title for table in computed.tables]
    before = json.loads(written["results.json"])
    after = json.loads((tmp_path / "results.json").read_text())
    assert before.pop("timing_s").keys() == {"plan", "simulate", "report"}
    assert after.pop("timing_s") == {}
    assert after == before


def test_verb_diff_prints_table_and_json(first, second):
    done = verb("diff", first, second)
    assert done.exit_code == 0, done.output
    assert "Changes" in done.stdout
    assert "24 runs with the same key have different results" in done.stdout
    assert '"verdict": "better"' in verb("diff", first, second, "--json").stdout
    same = verb("diff", first, first)
    assert same.stdout.splitlines() == [
        "48 runs in common, 48 with the same key. All values are equal."
    ]


def test_verb_export(first, tmp_path):
    done = verb("export", first, "--out", tmp_path / "runs.csv")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("48 runs written to ")


@pytest.mark.usefixtures("_with_figures")
def test_verb_report_of_a_part_of_a_study(tmp_path):
    folder = made(tmp_path / "a", stored=40, changes={"axes": {}, "repetitions": 30})
    done = verb("report", folder, "--metric", "mae")
    assert done.exit_code == 0, done.output
    assert "Noise 8 s: no difference in MAE is shown between" in " ".join(done.stdout.split())
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "20 of 60 planned runs are not finished" in page
    assert (folder / "tables" / "verdict.csv").is_file()
    assert (folder / "figures" / "pairs.svg").is_file()


def test_studies_in_folders_of_a_folder_are_named(tmp_path):
    for name in ("held-out", "training"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "study.yaml").touch()
    with pytest.raises(InvalidStore, match=r"there are studies in .*held-out, .*training$"):
        read_study(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("report", "none"), "there is no study in"), (("export", "none", "--out", "a.csv"), "none")],
)
def test_missing_study_is_an_error(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = verb(*arguments)
    assert isinstance(done.exception, OmnidriveError)
    assert message in str(done.exception)


def test_unknown_metric_is_an_error(first):
    done = verb("report", first, "--metric", "mee")
    assert isinstance(done.exception, InvalidInput)
    assert "no metric 'mee'; did you mean 'me'" in str(done.exception)


def test_study_without_runs_is_an_error(tmp_path):
    folder = made(tmp_path / "a", stored=1)
    with Store(folder) as store:
        store.begin("another definition")
    with pytest.raises(InvalidInput, match="no run of the study in"):
        read_study(folder)


def test_temporary_files_of_killed_writers_are_removed(tmp_path):
    """Those of processes that run are kept."""
    folder = made(tmp_path / "a", stored=40)
    (folder / "tables").mkdir()
    left = [
        folder / f".report.html.{_COMPUTER}-{2**31 - 1}-0.part",
        folder / "tables" / f".verdict.csv.{_COMPUTER}-{2**31 - 1}-1.part",
        folder / f".runs.sqlite.{_COMPUTER}-{2**31 - 1}-2.part-wal",
    ]
    other = tmp_path / f".runs.csv.{_COMPUTER}-{2**31 - 1}-2.part"
    kept = folder / f".report.html.{_COMPUTER}-{os.getpid()}-9999.part"
    for each in (*left, other, kept):
        each.touch()
    study = read_study(folder)
    report_study(study)
    export_study(study, tmp_path / "runs.csv")
    assert [each.exists() for each in (*left, other, kept)] == [False] * 4 + [True]


def test_set_up_lists_faults_and_what_else_differs_from_the_default():
    scenario = {
        **DEFINITION["scenario"],
        "plant": "planar",
        "robot": {"name": "paper", "friction": 0.4},
        "faults": [{"kind": "wheel-dead", "wheel": 2, "at": 5.0}],
        "wheel_monitor": False,
    }
    stated = setup_facts(parse_definition({**DEFINITION, "scenario": scenario}, "test"))
    assert stated["Robot"] == "paper (friction: 0.4)"
    assert "wheel-dead" in stated["Faults"]
    assert "wheel: 2" in stated["Faults"]
    assert stated["Wheel monitor"] == "false"
    assert stated["Tasks"] == "noise (durations: [8.0])"
    usual = setup_facts(parse_definition(DEFINITION, "test"))
    assert usual["Robot"] == "paper"
    assert not {"Faults", "Wheel monitor", "Watchdog", "Sensors", "Map"} & usual.keys()


def test_set_up_omits_what_an_axis_sets():
    axes = {"faults": [[], [{"kind": "wheel-dead", "wheel": 2, "at": 5.0}]]}
    scenario = {
        **DEFINITION["scenario"],
        "plant": "planar",
        "faults": [{"kind": "wheel-dead", "wheel": 1, "at": 5.0}],
    }
    stated = setup_facts(parse_definition({**DEFINITION, "scenario": scenario, "axes": axes}, "t"))
    assert "Faults" not in stated
    assert "Axis faults" in stated


def test_failed_runs_without_a_detail_have_a_reason(tmp_path):
    definition = parse_definition(DEFINITION, "test")
    run = RunPlan(definition)[0]
    record = replace(_record(run, 0.0), outcome="stalled", finished=False)
    with Store(tmp_path) as store:
        store.begin("hash")
        store.add([record])
        assert store.status().failures == [(run.number, "stalled")]


@pytest.mark.usefixtures("_with_figures")
def test_figures_are_written_in_the_chosen_formats_or_not_at_all(first, tmp_path):
    def written(*options):
        folder = tmp_path / "-".join(("out", *options))
        done = verb("report", first, "--out", folder, *options)
        assert done.exit_code == 0, done.output
        suffixes = {path.suffix for path in folder.glob("figures/*")}
        return suffixes, "<figure" in (folder / "report.html").read_text(encoding="utf-8")

    assert written("--figures", "png") == ({".png"}, True)
    assert written("--figures", "none") == (set(), False)
    refused = verb("report", first, "--figures", "jpg")
    assert refused.exit_code != 0
    assert "figure format" in str(refused.exception)
