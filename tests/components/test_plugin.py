"""The package in examples/plugin, installed into an environment of its own."""

import json
import os
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.components.distribution import WITHOUT_FIGURES, environment_with, run_python

PLUGIN = Path(__file__).parents[2] / "examples" / "plugin"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Return environment variables with which Python finds the installed plugin."""
    target = tmp_path_factory.mktemp("environment")
    install = ("-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps")
    offline = ("--no-build-isolation", "--no-index", "--target", target, PLUGIN)
    run(os.environ, target, *install, *offline)
    return environment_with(target)


def run(environment, cwd, *arguments):
    done = run_python(environment, cwd, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_tests_of_the_plugin_pass(environment, tmp_path):
    test = PLUGIN / "tests" / "test_laws.py"
    pytest_options = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull)
    assert "1 passed" in run(environment, tmp_path, *pytest_options, test)


def test_plugin_is_listed_and_bit_identical_with_the_same_law_built_in(environment, tmp_path):
    code = """
import omnidrive as od
from pathlib import Path
scenario = od.paper_scenario().with_values(
    controllers=["decay", "feedforward"], plant="planar", tasks={"track": {"durations": [17, 20]}}
)
study = od.run_study(scenario, processes=1)
for run in study.logs.runs:
    run.log.save(f"{run.name}.parquet")
print(scenario.controllers["decay"].component.origin, flush=True)
import sys
from omnidrive.cli import main
sys.argv = ["omnidrive", "list", "controllers", "decay"]
main()
"""
    out = run(environment, tmp_path, "-c", code)
    assert out.startswith("omnidrive-decay 0.1.0\n")
    assert "decay  (omnidrive-decay 0.1.0)" in out
    assert "position = 5.0 1/s (number, 0 to 50): Decay rate of the position error" in out
    for duration in (17, 20):
        one, two = (
            pq.read_table(tmp_path / f"track-{name}-{duration}s.parquet")
            for name in ("decay", "feedforward")
        )
        for column in one.column_names:
            if column != "step_time":
                assert one[column].to_numpy().tobytes() == two[column].to_numpy().tobytes()


@pytest.mark.long
def test_plugin_takes_part_in_compare(environment, tmp_path):
    arguments = ("--tasks", "step", "--plant", "kinematic", "--jobs", "2", "--out", "out")
    controllers = ("--controller", "decay", "--controller", "feedforward")
    run(environment, tmp_path, "-c", WITHOUT_FIGURES, "compare", *controllers, *arguments)
    origins = json.loads((tmp_path / "out" / "results.json").read_text())["components"]
    assert origins["controllers"]["decay"] == "omnidrive-decay 0.1.0"
