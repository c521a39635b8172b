"""Picture of a planned motion: its columns, the image of its costs, and its page in a browser."""

import base64
import io
import json
import re
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from PIL import Image

from omnidrive.evaluation.page import PlanPage
from omnidrive.evaluation.page.payload import plan_payload
from omnidrive.evaluation.page.plan_payload import layers_data
from omnidrive.evaluation.plan_view import PlanView
from omnidrive.maps import CostMap, Lane, OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference import MotionLimits, limit_rows, time_within_limits
from omnidrive.robot import named_robot
from tests.evaluation.recorded import page_text, reported

ROBOT = named_robot("paper")
HOSTILE = "</script><script>window.hacked=1</script>{{data}}"


def arc():
    """Return three quarters of a circle with a radius of 2 m."""
    angles = np.linspace(0.0, 1.5 * pi, 60)
    points = np.column_stack([4.0 + 2.0 * np.cos(angles), 4.0 + 2.0 * np.sin(angles)])
    return SplinePath(np.column_stack([points, angles + 0.5 * pi]))


def view(costs=None, grid=None):
    """Return a plan along the arc, driven within limits."""
    grid = OccupancyGrid(np.zeros((80, 80), bool), 0.1) if grid is None else grid
    path, limits = arc(), MotionLimits.of_robot(ROBOT)
    motion = time_within_limits(path, ROBOT.chassis, limits, zones=costs)
    times = np.linspace(0.0, motion.duration, 1001)
    rows = motion.window(0.0, 1001, motion.duration / 1000)
    clearance = grid.clearance(rows[:, :2]) - ROBOT.body_radius
    rows_of_limits = limit_rows(ROBOT.chassis, limits)
    free_space = grid.inflated(0.3)
    return PlanView(ROBOT, grid, free_space, None, times, rows, clearance, rows_of_limits, costs)


def zoned():
    """Return costs with every kind of layer, and an obstacle."""
    occupied = np.zeros((80, 80), bool)
    occupied[38:42, 38:42] = True
    grid = OccupancyGrid(occupied, 0.1)
    speeds = np.full((80, 80), np.inf, np.float32)
    speeds[50:70, 20:60] = 0.2
    forbidden = np.zeros((80, 80), bool)
    forbidden[70:76, 70:76] = True
    costs = replace(
        CostMap.of(replace(grid, occupied=occupied | forbidden)),
        max_speed=speeds, forbidden=forbidden,
    ).with_inflation(0.3)  # fmt: skip
    return grid, costs.with_lanes([Lane([(0, 0), (2, 0), (2, 8), (0, 8)], 0.5 * pi)])


def test_columns_of_a_circle():
    plan = view()
    assert plan.distance[-1] == pytest.approx(1.5 * pi * 2.0, rel=5e-3)
    u = np.linspace(0.0, 1.0, 20001)
    along = cumulative_length(arc().poses(u)[:, :2])
    expected = np.interp(plan.distance, along, arc().curvature(u))
    np.testing.assert_allclose(plan.curvature[1:-1], expected[1:-1], atol=0.01)
    assert np.isnan(plan.curvature[[0, -1]]).all()
    assert (plan.speed <= plan.top_speed * (1.0 + 1e-3)).all()
    assert plan.cost is None


def test_speed_limit_and_cost_are_those_of_the_cells():
    grid, costs = zoned()
    plan = view(costs, grid)
    slow = np.isfinite(costs.max_speeds(plan.motion[:, :2]))
    assert 50 < slow.sum() < 900
    np.testing.assert_allclose(plan.top_speed[slow], 0.2, rtol=1e-6)
    assert (plan.top_speed[~slow] > 0.5).all()
    for k in (0, 300, 700):
        row, col = grid.cells_of(plan.motion[k : k + 1, :2])[0]
        assert plan.cost[k] == pytest.approx(costs.costs[row, col])


def test_image_has_costs_and_zones():
    _, costs = zoned()
    data = layers_data(costs)
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(data["png"]))))[::-1]
    shown = np.where(costs.grid.occupied, 0.0, costs.costs)
    np.testing.assert_allclose(
        pixels[..., 0] / 255.0 * data["topCost"], shown, atol=data["topCost"] / 254.0
    )
    np.testing.assert_array_equal(pixels[..., 1] > 0, np.isfinite(costs.max_speed))
    assert (data["topSpeed"], data["lowSpeed"]) == (0.2, 0.2)
    np.testing.assert_array_equal(pixels[..., 2] == 255, costs.kept_out)
    lane = pixels[40, 5, 2]
    assert (lane - 1) / 254.0 * 2.0 * pi == pytest.approx(0.5 * pi, abs=0.02)
    assert data["keptOut"]
    assert data["lanes"]


def test_maps_without_costs_have_no_image():
    grid = OccupancyGrid(np.zeros((9, 9), bool), 0.1)
    assert layers_data(None) is None
    assert layers_data(CostMap.of(grid)) is None


def test_large_maps_are_reduced():
    """Thin walls and the strictest limits remain."""
    rng = np.random.default_rng(0)
    occupied = rng.random((3000, 2500)) < 1e-3
    grid = OccupancyGrid(occupied, 0.01)
    speeds = np.full(occupied.shape, np.inf, np.float32)
    speeds[1000, 1000] = 0.1
    costs = replace(CostMap.of(grid), max_speed=speeds).with_costs(rng.random(occupied.shape))
    text = plan_payload(replace(view(), obstacles=grid, free_space=grid, costs=costs))
    data = json.loads(text)
    assert len(text) < 3e6
    assert (data["map"]["rows"], data["map"]["cols"]) == (1500, 1250)
    kinds = np.repeat(data["map"]["kinds"][::2], data["map"]["kinds"][1::2]).reshape(1500, 1250)
    blocks = occupied.reshape(1500, 2, 1250, 2).any(axis=(1, 3))
    np.testing.assert_array_equal(kinds == 2, blocks)
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(data["layers"]["png"]))))[::-1]
    assert pixels.shape == (750, 625, 3)
    assert pixels[250, 250, 1] == 255
    assert data["layers"]["cell"] == pytest.approx(0.04)


@pytest.fixture(scope="module")
def page_of():
    grid, costs = zoned()
    plan = view(costs, grid)
    return plan, PlanPage(HOSTILE, {"length": "9.42 m", "duration": "9 s"}, plan).text()


def settle(page):
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => setTimeout(done, 30)))")


@pytest.mark.browser
def test_chart_moves_the_robot_on_the_map(show, page_of):
    plan, text = page_of
    page = show(text)
    assert page.evaluate("window.hacked") is None
    box = page.locator("#plan-chart .u-over").bounding_box()
    before = page.locator("#plan-map").screenshot()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.5 * box["height"])
    settle(page)
    row = page.evaluate("PlanView.row()")
    assert plan.distance[row] == pytest.approx(0.7 * plan.distance[-1], rel=0.01)
    tip = page.locator("#plan-chart-tip").inner_text()
    for value, unit in ((plan.distance, "m"), (plan.times, "s"), (plan.speed, "m/s"),
                        (plan.top_speed, "m/s"), (plan.clearance, "m"),
                        (plan.curvature, "1/m"), (plan.cost, "")):  # fmt: skip
        digits = 2 if unit in {"s", ""} or value is plan.distance else 3
        assert f"{value[row]:.{digits}f} {unit}".strip() in tip
    assert page.locator("#plan-map").screenshot() != before
    page.mouse.move(2, 2)
    page.wait_for_selector("#plan-chart-tip", state="hidden")
    assert page.evaluate("PlanView.row()") == row  # the robot stays


@pytest.mark.browser
def test_map_moves_the_mark_of_the_chart(show, page_of):
    plan, text = page_of
    page = show(text)
    x, y = page.evaluate(
        "([x, y]) => PlanView.camera.toScreen(x, y)", plan.motion[300, :2].tolist()
    )
    box = page.locator("#plan-map").bounding_box()
    page.mouse.move(box["x"] + x, box["y"] + y)
    settle(page)
    row = page.evaluate("PlanView.row()")
    assert abs(plan.distance[row] - plan.distance[300]) < 0.05
    assert f"{plan.distance[row]:.2f} m" in page.locator("#plan-map-tip").inner_text()
    over = page.locator("#plan-chart .u-over").bounding_box()
    mark = page.locator("#plan-chart .time-mark").bounding_box()
    share = (mark["x"] + 1.0 - over["x"]) / over["width"]
    assert share == pytest.approx(plan.distance[row] / plan.distance[-1], abs=0.01)


@pytest.mark.browser
def test_keys_and_slider_move_the_robot(show, page_of):
    plan, text = page_of
    page = show(text)
    page.locator("#plan-map").focus()
    for key, row in (("Home", 0), ("ArrowRight", 1), ("PageUp", 51), ("ArrowLeft", 50),
                     ("End", 1000)):  # fmt: skip
        page.keyboard.press(key)
        assert page.evaluate("PlanView.row()") == row
    page.locator("#plan-at").fill("400")
    values = page.locator("#plan-values").inner_text()
    assert f"{plan.speed[400]:.3f} m/s" in values
    assert f"{plan.speed[400]:.3f} m/s" in page.get_attribute("#plan-at", "aria-valuetext")
    page.select_option("#plan-second", "curvature")
    assert page.inner_text("#plan-second-name") == "curvature in 1/m"
    page.select_option("#plan-second", "")
    assert not page.locator("#plan-second-key").is_visible()


def colour_at(page, x, y):
    """Return the colour of the map at a point of the world."""
    settle(page)
    shown = Image.open(io.BytesIO(page.locator("#plan-map").screenshot())).convert("RGB")
    px, py = page.evaluate("([x, y]) => PlanView.camera.toScreen(x, y)", [x, y])
    return shown.getpixel((int(px), int(py)))


@pytest.mark.browser
def test_layers_are_drawn_in_their_place_and_can_be_hidden(show, page_of):
    _, text = page_of
    page = show(text)
    page.locator("#plan-layer-inflated").uncheck()
    page.wait_for_timeout(200)  # the image of the layers
    white = (255, 255, 255)
    zone, kept, costly = (2.45, 5.65), (7.35, 7.35), (3.7, 3.45)  # between the lines of the grid
    costs = colour_at(page, *costly)
    assert costs[0] > costs[2] + 20  # yellow to red
    page.locator("#plan-layer-costs").uncheck()
    assert colour_at(page, *costly) == white
    blue, magenta = colour_at(page, *zone), colour_at(page, *kept)
    assert blue[2] > blue[0] + 20
    assert magenta[1] < min(magenta[0], magenta[2]) - 20
    page.locator("#plan-layer-zones").uncheck()
    assert colour_at(page, *zone) == white
    assert page.locator("#plan-speed-text").inner_text() == "speed zone, 0.2 m/s"


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 400])
def test_page_fits_the_window_in_both_themes(show, page_of, width):
    page = show(page_of[1], viewport={"width": width, "height": 800}, color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.locator("#plan-layer-costs").uncheck()
    dark = colour_at(page, 7.9, 0.1)
    page.click("#theme")
    assert min(colour_at(page, 7.9, 0.1)) > max(dark) + 100
    page.locator("#plan-chart").scroll_into_view_if_needed()
    box = page.locator("#plan-chart .u-over").bounding_box()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.5 * box["height"])
    settle(page)
    tip = page.locator("#plan-chart-tip").bounding_box()
    assert 0 <= tip["x"] <= width - tip["width"]


@pytest.mark.browser
def test_report_shows_the_plan(show, part):
    """Keys on the map of the plan do not move the playback."""
    grid, costs = zoned()
    logs = replace(part, obstacles=grid, free_space=grid, plan=view(costs, grid))
    text = page_text(reported(logs))
    assert re.search(r'<section id="plan"', text)
    page = show(text)
    assert page.locator("#layer-costs").is_visible()
    assert page.locator("#speed-key").is_visible()
    time = page.evaluate("Playback.time()")
    page.locator("#plan-map").focus()
    page.keyboard.press("Home")
    assert page.evaluate("PlanView.row()") == 0
    assert page.evaluate("Playback.time()") == time
    page = show(page_text(reported(part)))
    assert page.locator("#plan").count() == 0
    assert not page.locator("#layer-costs").is_visible()
    assert not page.locator("#costs-key").is_visible()
