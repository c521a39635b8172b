"""Representations in notebooks, figures of objects, and logs as tables and files."""

import json
import sys
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure
from mcap.reader import make_reader
from PIL import Image

import omnidrive as od
from omnidrive.control.supervision import Event
from omnidrive.errors import CannotWrite, InvalidInput, MissingExtra
from omnidrive.evaluation import plot
from omnidrive.fuzzy import (
    Footprint,
    FuzzySet,
    FuzzySystem,
    Inference,
    InputVariable,
    LinearFunction,
    Membership,
    OutputVariable,
    parse_rule,
)
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import ROBOTS
from omnidrive.study import run_study
from tests.study.small import small_scenario

HOSTILE = '<script>alert("x")</script>'


def text_of(html):
    """Check that HTML is well formed, and return its text."""
    root = ElementTree.fromstring(f"<root>{html}</root>")
    assert not list(root.iter("script"))
    assert len(html) < 40_000
    return " ".join(root.itertext())


@pytest.fixture(scope="module")
def run():
    robot = od.named_robot("small")
    reference = od.SampledReference.through(
        np.array([0.0, 1.0, 2.0]), np.array([[0, 0, 0], [0.4, 0.1, 0.3], [0.8, 0, 0.6]], float)
    )
    controller = od.FeedforwardController(dt=0.1)
    finished = od.simulate(
        od.KinematicPlant(robot), controller, reference, start=od.Pose(0.0, 0.0, 0.0), dt=0.1
    )
    return replace(
        finished,
        events=(Event(1.0, f"slope begins {HOSTILE}"),),
        details={"gain": np.where(finished.t < 2.0, 3.0, np.nan)},
        detail_units={"gain": "1/s"},
    )


@pytest.fixture(scope="module")
def plan():
    occupied = np.zeros((40, 50), bool)
    occupied[10:40, 20:22] = True
    grid = OccupancyGrid(occupied, 0.1, origin=(-1.0, 2.0), yaw=0.3)
    start, goal = (grid.centre(30, col) for col in (5, 45))
    return od.plan(
        grid, od.Waypoint(*start), od.Waypoint(*goal), inflation=0.2, options=od.PathOptions()
    )


@pytest.fixture(scope="module")
def study():
    scenario = small_scenario(controllers=("fuzzy_t1", "holonomic-nmpc"))
    tasks = scenario.tasks.model_copy(update={"horizon": None, "noise": None})
    return run_study(scenario.model_copy(update={"tasks": tasks}))


def sugeno(name="s"):
    sets = (FuzzySet("low", Membership("trimf", (-1, 0, 1))),)
    functions = (LinearFunction("flat", 2.0), LinearFunction("tilted", 1.0, (3.0,)))
    return FuzzySystem(
        name,
        (InputVariable("x", 0, 1, sets),),
        (OutputVariable("y", 0, 1, functions),),
        (parse_rule("if x is low then y is flat"),),
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_shows_its_wheels(name):
    robot = od.named_robot(name)
    html = robot._repr_html_()
    assert f"Robot {name}" in text_of(html)
    assert html.count("<polygon") == len(robot.mounts)
    assert "mecanum" in html if name == "mecanum" else "omni" in html


def test_a_robot_is_drawn_with_x_upwards():
    """A wheel in front of the centre is above it, one on the left to the left."""
    robot = od.named_robot("kiwi")
    polygons = ElementTree.fromstring(f"<r>{robot._repr_html_()}</r>").iter(
        "{http://www.w3.org/2000/svg}polygon"
    )
    centres = [
        np.mean([[float(c) for c in p.split(",")] for p in each.get("points").split()], axis=0)
        for each in polygons
    ]
    middle = np.mean(centres, axis=0)
    for mount, (x, y) in zip(robot.mounts, centres, strict=True):
        assert (y < middle[1]) == (mount.x > 0.0)
        if abs(mount.y) > 1e-9:
            assert (x < middle[0]) == (mount.y > 0.0)


def test_fuzzy_systems_show_their_sets():
    html = sugeno()._repr_html_()
    assert "Sugeno, type 1" in text_of(html)
    uncertain = sugeno().with_footprint(Footprint(0.8, 0.2))
    assert uncertain._repr_html_().count("<polygon") == 1  # the footprint
    assert Inference(uncertain)._repr_html_() == uncertain._repr_html_()


def test_names_are_escaped(run):
    assert HOSTILE in text_of(sugeno(HOSTILE)._repr_html_())
    assert HOSTILE in text_of(replace(od.named_robot("small"), name=HOSTILE)._repr_html_())
    assert HOSTILE in text_of(run._repr_html_())


def test_a_run_shows_its_errors(run):
    distance = np.hypot(*(run.pose - run.target)[:, :2].T)
    text = text_of(run._repr_html_())
    assert f"{distance.max():.4g} m" in text
    assert run.outcome.value in text
    assert "nan" not in text


def test_a_run_that_failed_at_its_start_is_shown():
    class Failing:
        def reset(self, state):
            raise RuntimeError("no sensors")

        def step(self, t, state, reference):
            raise NotImplementedError

    failed = od.simulate(
        od.KinematicPlant(od.named_robot("small")),
        Failing(),
        od.Hold(od.Pose(1.0, 0.0, 0.0), 1.0),
        start=od.Pose(0.0, 0.0, 0.0),
        dt=0.1,
    )
    assert "no sensors" in text_of(failed._repr_html_())
    assert isinstance(plot(failed), Figure)


def test_a_plan_shows_its_path(plan):
    html = plan._repr_html_()
    assert f"{plan.spline.length:.3f} m" in text_of(html)
    assert html.count("<polygon") >= 10  # the wall


def test_the_picture_of_a_large_map_is_small():
    occupied = np.random.default_rng(1).random((2000, 3000)) < 0.002
    occupied[:10, :10] = False
    plan = od.plan(
        OccupancyGrid(occupied, 0.05), od.Waypoint(0.1, 0.1), od.Waypoint(0.3, 0.3),
        inflation=0.0, options=od.PathOptions(),
    )  # fmt: skip
    assert len(plan._repr_html_()) < 300_000


def test_a_study_shows_its_tables(study):
    text = text_of(study._repr_html_())
    assert study.facts.name in text
    assert study.tables[0].rows[0][0] in text
    lead = study.tables[0].lead
    assert lead
    assert lead in text


def check_figure(figure):
    assert isinstance(figure, Figure)
    with Image.open(BytesIO(figure._repr_png_())) as image:
        assert np.asarray(image.convert("L")).std() > 5.0


def test_figures_are_drawn_without_global_state(run, plan, study):
    for figure in (plot(run), plot(plan), plot(study), plot(study, "step_response")):
        check_figure(figure)
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or not pyplot.get_fignums()


def test_the_figure_of_a_run_shows_events(run):
    path, distance, _ = plot(run).axes
    np.testing.assert_array_equal(path.lines[0].get_ydata(), run.pose[:, 1])
    assert [line.get_xdata()[0] for line in distance.lines[1:]] == [1.0]


def test_unknown_figures_are_refused(study):
    with pytest.raises(InvalidInput, match="did you mean 'xy_comparison'"):
        plot(study, "xy_comparson")
    with pytest.raises(InvalidInput, match=r"no runs for the figure horizon_bars; it has .*step"):
        plot(study, "horizon_bars")


def test_what_has_no_figure_is_refused(run):
    with pytest.raises(InvalidInput, match="only a study has several figures, got figure='a'"):
        plot(run, "a")


def test_a_run_as_pandas_table(run):
    frame = run.to_pandas()
    np.testing.assert_array_equal(frame[["x", "y", "yaw"]].to_numpy(), run.pose)
    np.testing.assert_array_equal(frame["gain"], run.details["gain"])
    assert frame.attrs["units"]["actual_yaw_rate"] == "rad/s"
    assert frame["status"].dtype.kind == "i"


def test_parquet_and_csv_keep_every_value(run, tmp_path):
    run.save(str(tmp_path / "run.parquet"))
    run.save(tmp_path / "run.CSV")
    table = pq.read_table(tmp_path / "run.parquet")
    assert table.field("gain").metadata == {b"unit": b"1/s"}
    pd.testing.assert_frame_equal(table.to_pandas(), run.to_pandas(), check_exact=True)
    frame = pd.read_csv(tmp_path / "run.CSV")  # a column of zeros is one of integers
    pd.testing.assert_frame_equal(frame, run.to_pandas(), check_exact=True, check_dtype=False)
    assert {path.name for path in tmp_path.iterdir()} == {"run.parquet", "run.CSV"}


def messages(path):
    with path.open("rb") as file:
        reader = make_reader(file)
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            known = json.loads(schema.data)["properties"]
            data = json.loads(message.data)
            assert set(data) <= set(known)
            stamp = data["timestamp"]
            assert stamp["sec"] * 10**9 + stamp["nsec"] == message.log_time
            yield channel.topic, schema.name, message.log_time * 1e-9, data


def test_mcap_contains_every_sample(run, tmp_path):
    run.save(tmp_path / "run.mcap")
    found = list(messages(tmp_path / "run.mcap"))
    count = len(run.t)
    by_topic = {}
    for topic, *rest in found:
        by_topic.setdefault(topic, []).append(rest)
    assert {topic: len(each) for topic, each in by_topic.items()} == {
        "/target_path": 1, "/log": count, "/pose": count, "/measured": count, "/target": count,
        "/tf": count, "/events": 2,
    }  # fmt: skip
    logs = [data for _, _, data in by_topic["/log"]]
    assert [row["command_vx"] for row in logs] == run.command[:, 0].tolist()
    assert "work" not in logs[0]  # unknown on this plant
    assert "gain" in logs[0]
    assert "gain" not in logs[-1]
    assert len(by_topic["/target_path"][0][2]["poses"]) == count
    schema, t, transform = by_topic["/tf"][-1]
    assert (schema, t) == ("foxglove.FrameTransform", pytest.approx(run.t[-1]))
    rotation = transform["rotation"]
    assert 2 * np.arctan2(rotation["z"], rotation["w"]) == pytest.approx(run.pose[-1, 2])
    assert transform["translation"]["y"] == run.pose[-1, 1]
    assert [data["message"] for _, _, data in by_topic["/events"]] == [
        run.events[0].what, f"end: {run.ending}",
    ]  # fmt: skip


def test_equal_runs_give_identical_mcap_files(run, tmp_path):
    for name in ("a.mcap", "b.mcap"):
        run.save(tmp_path / name)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize(
    ("module", "package", "call"),
    [
        ("pandas", "pandas", lambda run, folder: run.to_pandas()),
        ("mcap.writer", "mcap", lambda run, folder: run.save(folder / "run.mcap")),
    ],
)
def test_a_missing_extra_is_named(run, tmp_path, monkeypatch, module, package, call):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra, match=f"pip install {package}"):
        call(run, tmp_path)
    assert not list(tmp_path.iterdir())


def test_logs_that_cannot_be_written(run, tmp_path):
    with pytest.raises(InvalidInput, match=r"one of \.parquet, \.csv, \.mcap"):
        run.save(tmp_path / "run.txt")
    for suffix in ("parquet", "csv", "mcap"):
        with pytest.raises(CannotWrite, match=r"no.*choose another path"):
            run.save(tmp_path / "absent" / f"run.{suffix}")
        (tmp_path / f"folder.{suffix}").mkdir()
        with pytest.raises(CannotWrite):
            run.save(tmp_path / f"folder.{suffix}")
