"""Scenarios of robots with an outline: planning, timing, clearance, runs and messages."""

import json
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.errors import InvalidReference, InvalidWaypoint, NoPathFound
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid, save_nav2_map
from omnidrive.planning import FootprintPlan, Plan
from omnidrive.planning.footprint import pose_distance
from omnidrive.robot import named_robot, save_robot
from omnidrive.scenario import load_scenario, plan_and_check
from omnidrive.study import run_study
from tests.scenario.doors import BOX, write_door

NAV2 = json.dumps(BOX)


@pytest.fixture
def scenario(tmp_path):
    """Return a function that reads the scenario with changes."""
    return lambda **changes: load_scenario(write_door(tmp_path, **changes))


@pytest.mark.parametrize("law", ["limits", "uniform"])
@pytest.mark.parametrize("outline", [BOX, NAV2])
def test_polygon_is_needed_and_its_headings_are_kept(scenario, law, outline):
    planned = plan_and_check(scenario(outline=outline, timing={"law": law}))
    assert planned.plan.shape == "polygon"
    assert "disc of radius 0.3328 m" in planned.plan.reason
    reference = planned.reference(8.0)
    poses = reference.window(0.0, 1601, 0.005)[:, :3]
    polygon = Polygon.of(np.array(BOX))
    distance = pose_distance(planned.obstacles, polygon, poses)
    low, high = planned.clearance_bounds
    assert 0.0 <= low <= distance + 1e-9
    assert high == pytest.approx(distance, abs=2e-3)
    assert planned.clearance(poses) == distance
    np.testing.assert_allclose(planned.clearances(np.stack([poses, poses])), distance)


@pytest.mark.parametrize("heading", ["path", "goal-first"])
def test_disc_is_planned_as_without_an_outline(scenario, tmp_path, heading):
    timing = {"law": "limits", "heading": heading}
    planned = plan_and_check(scenario(door=1.2, timing=timing))
    assert isinstance(planned.plan, FootprintPlan)
    assert planned.plan.shape == "disc"
    radius = float(np.hypot(*BOX[0]))
    save_robot(replace(named_robot("mecanum"), body_radius=radius), tmp_path / "circle.yaml")
    section = {"name": "circle.yaml"}
    plain = plan_and_check(scenario(door=1.2, outline=None, timing=timing, robot=section))
    assert isinstance(plain.plan, Plan)
    np.testing.assert_array_equal(planned.path.control_points, plain.path.control_points)
    assert planned.shortest == plain.shortest
    assert planned.clearance_bounds[0] == plain.clearance_bounds[0]
    assert planned.clearance_bounds[1] >= plain.clearance_bounds[1] - 1e-4


@pytest.mark.parametrize(
    ("timing", "fault"),
    [
        ({"law": "limits", "heading": "tangent"}, "heading 'tangent' contradicts"),
        ({"law": "limits", "heading": "fixed"}, "heading 'fixed' contradicts"),
    ],
)
def test_other_headings_are_refused(scenario, timing, fault):
    with pytest.raises(InvalidReference, match=fault):
        plan_and_check(scenario(timing=timing))


def test_minimum_time_of_the_polygon_is_proved(scenario):
    slower = plan_and_check(scenario())
    planned = plan_and_check(scenario(timing={"law": "minimum-time"}))
    assert planned.plan.shape == "polygon"
    assert planned.note.startswith("converged: ")
    assert planned.shortest < slower.shortest
    poses = planned.reference(8.0).window(0.0, 1601, 0.005)[:, :3]
    distance = pose_distance(planned.obstacles, Polygon.of(np.array(BOX)), poses)
    assert 0.0 <= planned.clearance_bounds[0] <= distance + 1e-9


def test_no_way_even_for_the_polygon(scenario):
    with pytest.raises(NoPathFound, match=r"polygon of 4 corners.*lower the margin"):
        plan_and_check(scenario(margin=0.05))
    with pytest.raises(NoPathFound, match="polygon of 4 corners"):
        plan_and_check(scenario(door=0.4))
    with pytest.raises(InvalidWaypoint, match="collides at the start"):
        plan_and_check(scenario(start=[1.8, 0.8, 0.0]))


def test_keep_out_zones_apply_to_the_polygon(scenario, tmp_path):
    mask = np.zeros((60, 80), bool)
    mask[25:35, 40] = True
    save_nav2_map(OccupancyGrid(mask, 0.05), tmp_path / "mask.yaml")
    with pytest.raises(NoPathFound, match="polygon"):
        plan_and_check(scenario(costs={"keepout": "mask.yaml"}))
    save_nav2_map(OccupancyGrid(np.zeros((60, 80), bool), 0.05), tmp_path / "mask.yaml")
    planned = plan_and_check(scenario(costs={"keepout": "mask.yaml"}))
    assert "only keep-out masks and speed zones" in planned.plan.reason
    assert planned.plan.costs is not None


def test_robot_drives_through_the_door_without_contact(scenario):
    study = run_study(scenario())
    (record,) = study.records
    assert record.metrics["collisions"] == 0
    assert record.metrics["min_clearance"] > 0.0
