"""A distribution with a component of every group takes part in a study."""

import json

import numpy as np
import pytest
import yaml

from omnidrive.components import GROUPS
from omnidrive.scenario import paper_scenario
from omnidrive.scenario.scenario_file import scenario_data
from tests.components.distribution import WITHOUT_FIGURES, environment_with, install, run_python

CODE = '''
"""Components of every group."""

from dataclasses import replace

import numpy as np
import omnidrive as od
from omnidrive.estimation import LatestFix
from omnidrive.simulation import KinematicPlant


def law(context):
    """Feedforward of the reference."""
    return od.FeedforwardController(context.dt)


def broken(context):
    """Raise an exception."""
    return {}["gain"]


class Plant(KinematicPlant):
    """Kinematic plant."""

    capabilities = od.PlantCapabilities()

    def __init__(self, context):
        super().__init__(context.robot)


def robot():
    """A robot with faster motors."""
    return replace(od.named_robot("small"), name="quick", max_wheel_speed=60.0)


def estimator():
    """Latest pose fix."""
    return LatestFix()


def read_grid(path, *, resolution=None, unknown="occupied"):
    """Map of comma-separated zeros and ones."""
    rows = [[cell == "1" for cell in line.split(",")] for line in open(path).read().split()]
    return od.OccupancyGrid(np.array(rows), resolution or 1.0)


class Board:
    """Link of a motor board."""

    def __init__(self, context):
        self.robot = context.robot

    open = read = send = stop = close = lambda *_: None


def ellipse(context):
    """Half an ellipse from rest to rest."""
    t = np.linspace(0.0, 1.0, 400)
    s = np.pi * t**3 * (10 - 15 * t + 6 * t**2)
    poses = np.stack([3 + 1.5 * np.cos(s), 3 + np.sin(s), np.zeros_like(s)], axis=1)
    return od.SampledReference(20.0 * t, poses, np.gradient(poses, 20.0 * t, axis=0))
'''
ENTRY_POINTS = """
[omnidrive.controllers]
their-law = their_parts:law
broken = their_parts:broken
[omnidrive.plants]
their-plant = their_parts:Plant
broken = their_parts:broken
[omnidrive.robots]
quick = their_parts:robot
[omnidrive.estimators]
their-estimator = their_parts:estimator
[omnidrive.maps]
.grid = their_parts:read_grid
[omnidrive.references]
ellipse = their_parts:ellipse
[omnidrive.links]
board = their_parts:Board
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Return environment variables with which Python finds the distribution."""
    folder = tmp_path_factory.mktemp("their")
    install(folder, "their-parts", "1.2", ENTRY_POINTS, CODE)
    return environment_with(folder)


def omnidrive(environment, cwd, *arguments):
    return run_python(environment, cwd, "-c", WITHOUT_FIGURES, *arguments)


def test_components_of_every_group_take_part_in_a_study(environment, tmp_path):
    cells = np.zeros((8, 8), dtype=int)
    cells[0, 0] = 1
    (tmp_path / "room.grid").write_text("\n".join(",".join(map(str, row)) for row in cells))
    data = scenario_data(paper_scenario())
    for key in ("start", "goal", "path", "timing"):
        data.pop(key, None)
    data |= {
        "map": {"source": "room.grid"},
        "robot": {"name": "quick"},
        "plant": "their-plant",
        "sensors": {"estimator": {"type": "their-estimator"}},
        "reference": {"type": "ellipse"},
        "controllers": {"theirs": "their-law", "ours": "feedforward"},
        "tasks": {"track": {"durations": [20.0]}},
    }
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(data))
    done = omnidrive(environment, tmp_path, "compare", "s.yaml", "--jobs", "1", "--out", "out")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    theirs, ours = results["runs"]
    assert theirs["me"] == ours["me"]
    origins = results["components"]
    assert origins["plant"] == origins["estimator"] == "their-parts 1.2"
    assert origins["controllers"]["theirs"] == "their-parts 1.2"


@pytest.mark.long
def test_components_are_listed_and_one_that_raises_is_named_with_the_line(environment, tmp_path):
    code = """
from omnidrive.components import GROUPS, component_names, find_component
for group in GROUPS:
    for name in component_names(group):
        print(group, name, find_component(group, name).origin, sep="|")
"""
    code += "import sys; sys.argv[1:] = ['run', '--plant', 'broken', '--controller', 'pid']\n"
    code += "from omnidrive.cli import main; main()"
    done = run_python(environment, tmp_path, "-c", code)
    assert done.returncode == 2
    assert "the plant 'broken' (their-parts 1.2) failed:" in done.stderr
    assert "their_parts.py" in done.stderr
    assert "KeyError: 'gain'" in done.stderr
    theirs = {line.split("|")[0]: line for line in done.stdout.split("\n") if "their-parts" in line}
    assert set(theirs) == set(GROUPS)
    assert theirs["maps"] == "maps|.grid|their-parts 1.2"


@pytest.mark.long
def test_factory_that_raises_ends_its_run_only(environment, tmp_path):
    arguments = ("--plant", "their-plant", "--tasks", "step", "--out", "out")
    controllers = ("--controller", "broken", "--controller", "feedforward")
    done = omnidrive(environment, tmp_path, "compare", *controllers, *arguments)
    assert done.returncode == 1
    assert (
        "step-broken at 0 s (the controller had no usable command: KeyError: 'gain' (their_"
        in " ".join(done.stderr.split())
    )
    axes = json.loads((tmp_path / "out" / "results.json").read_text())["step_response"]
    assert {row["controller"]: row["finished"] for row in axes} == {
        "broken": False, "feedforward": True,
    }  # fmt: skip
