"""Markup and data of the report."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.robot import ROBOTS
from tests.evaluation.recorded import page_text, reported


def data_of(text):
    block = re.search(r'<script id="study" type="application/json">(.*?)</script>', text, re.S)
    return json.loads(block[1])


def text_of(logs, tables=()):
    """Return the page of logs with these tables."""
    return page_text(reported(logs), tables)


def test_page_is_small_and_deterministic(study, tmp_path):
    *_, path = reported(study).write(tmp_path, formats=())
    assert path == tmp_path / "report.html"
    assert 1e5 < path.stat().st_size < 3e6
    assert path.read_text(encoding="utf-8") == page_text(reported(study))


def test_characters_without_a_code_are_escaped(part, tmp_path):
    """Bytes in the name of a file that are not UTF-8."""
    list(reported(replace(part, title="mine\udcff.py")).write(tmp_path, formats=()))
    assert "<title>mine\\udcff.py" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_data_has_every_group_and_run(study):
    groups = {group["id"]: group for group in data_of(text_of(study))["groups"]}
    assert list(groups) == ["track-20", "track-30", "noise-30", "horizon-20", "step"]
    assert [len(group["runs"]) for group in groups.values()] == [4, 4, 4, 6, 4]
    assert [run["label"] for run in groups["track-20"]["runs"]] == [
        result.controller for result in study.select("track", duration=20.0)
    ]
    run, data = study.runs[0].log, groups["track-20"]["runs"][0]
    np.testing.assert_allclose(data["pose"][0], run.pose[:, 0], atol=5.1e-9)
    assert data["measured"] is None
    assert groups["noise-30"]["runs"][0]["measured"] is not None


@pytest.mark.parametrize("name", ROBOTS)
def test_data_has_wheel_poses(part, name):
    text = text_of(replace(part, robot=ROBOTS[name]))
    data = data_of(text)["robot"]["wheels"]
    assert [tuple(wheel.values()) for wheel in data] == [tuple(m) for m in ROBOTS[name].mounts]
    assert all(list(wheel) == ["x", "y", "axle", "roller"] for wheel in data)  # as in scene.js
    kind = "mecanum" if name == "mecanum" else "omni"
    assert f"{len(data)} {kind} wheels at " in text


def test_data_has_every_map_cell(study):
    data = data_of(text_of(study))["map"]
    kinds = np.repeat(data["kinds"][::2], data["kinds"][1::2]).reshape(data["rows"], data["cols"])
    np.testing.assert_array_equal(kinds == 2, study.obstacles.occupied)
    np.testing.assert_array_equal(kinds > 0, study.free_space.occupied)
    assert data["origin"] == [*study.obstacles.origin, 0.0]
    assert data["extent"] == list(study.obstacles.extent)


def test_numbers_that_are_not_finite_become_null(part):
    result = part.runs[0]
    twist = result.log.twist.copy()
    twist[5] = np.nan
    broken = replace(part, runs=(result._replace(log=replace(result.log, twist=twist)),))
    assert data_of(text_of(broken))["groups"][0]["runs"][0]["yawRate"][5] is None


def test_data_has_gains_with_inputs(tuning, study):
    (group,) = data_of(text_of(tuning))["groups"]
    assert [(q["title"], q["unit"]) for q in group["tuning"][:5]] == [
        ("kp", "1/s"), ("ki", "1/s²"), ("kd", ""),
        ("scaled error", ""), ("scaled change of error", ""),
    ]  # fmt: skip
    fuzzy, pid = (run["tuning"] for run in group["runs"])
    run = tuning.runs[0].log
    np.testing.assert_allclose(fuzzy["kp x"][:-1], run.details["kp_x"][:-1], atol=5.1e-6)
    assert fuzzy["kp x"][-1] is None
    assert set(fuzzy) - set(pid) == {
        f"{name} {axis}" for name in ("error_input", "change_input") for axis in ("x", "heading")
    }
    assert not any(group["tuning"] for group in data_of(text_of(study))["groups"])


def test_playback_shows_first_of_repeated_runs(study):
    repeated = replace(study, runs=study.select("noise"), repeats=2)
    (group,) = data_of(text_of(repeated))["groups"]
    assert group["label"] == "Noise 30 s, first of 2 seeds"
    assert group["runs"][0]["measured"] is not None


def test_verdict_is_above_the_scene(study):
    report = reported(study)
    body = page_text(report).split("<body>")[1]
    assert body.index(report.verdicts[0].value_text(report.verdicts[0].leader)) > 0
    assert body.index('class="lead"') < body.index('id="map"')


def test_best_cells_are_marked(study):
    report = reported(study)
    marked = sum(len(table.best) for table in report.tables)
    text = page_text(report)
    assert text.count('<td class="best">') == marked > 10
    assert "Bold: best in its column." in text


def test_lengths_of_both_paths_are_shown(study):
    smooth, grid = study.spline.length, study.grid_path.length
    assert smooth < grid - 0.01
    assert f"{smooth:.2f} m smoothed; grid path {grid:.2f} m, 12 cells" in text_of(study)


def test_page_loads_no_external_resources(study):
    text = page_text(reported(study))
    assert not re.search(r"""(?:src|href|action)=["']?(?!["'#]|data:)""", text.split("</head>")[0])
    assert "@import" not in text
    assert "url(" not in text
