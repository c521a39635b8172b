from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from omnidrive.evaluation.figures import draw_figures, write_figures
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.evaluation.figures.plan import draw_map
from omnidrive.evaluation.palette import controller_colour, controller_label, horizon_colours
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path
from omnidrive.robot import ROBOTS
from tests.evaluation.cutting import cut

DIAGRAMS = {"kinematics", "tracking_error", "membership_functions"}
ALL = DIAGRAMS | {
    "xy_comparison",
    "heading_comparison",
    "horizon_xy",
    "horizon_heading",
    "horizon_bars",
    "step_response",
    "noise_xy",
    "noise_heading",
}


@pytest.fixture(scope="module")
def files(study, tmp_path_factory):
    return list(write_figures(study, tmp_path_factory.mktemp("figures") / "made"))


def test_every_figure_is_written_as_png_and_svg(files):
    assert {path.name for path in files} == {f"{n}.{s}" for n in ALL for s in ("png", "svg")}


def test_pictures_show_something(files):
    for path in files:
        if path.suffix == ".png":
            with Image.open(path) as image:
                assert min(image.size) > 400, path.name
                assert np.asarray(image.convert("L")).std() > 5.0, path.name


def test_drawings_are_self_contained_and_undated(files):
    for path in files:
        if path.suffix == ".svg":
            text = path.read_text(encoding="utf-8")
            root = ElementTree.fromstring(text)
            links = [v for e in root.iter() for k, v in e.attrib.items() if k.endswith("href")]
            assert all(link.startswith(("#", "data:")) for link in links), path.name
            assert "dc:date" not in text
            assert len(list(root.iter())) > 50, path.name


def test_same_results_give_same_bytes(part, tmp_path):
    once, again = (
        [path.read_bytes() for path in write_figures(part, tmp_path / name)] for name in "ab"
    )
    assert once == again


def test_part_of_a_study_leaves_out_what_it_did_not_run(part):
    names = {name for name, _ in draw_figures(part)}
    assert names == DIAGRAMS | {"xy_comparison", "heading_comparison"}


def test_gains_are_drawn_where_they_are_logged(tuning):
    figures = dict(draw_figures(tuning))
    assert set(figures) - DIAGRAMS == {"xy_comparison", "heading_comparison", "gain_history"}
    panels = figures["gain_history"].axes
    assert len(panels) == 5 * 2
    assert [len(axes.lines) for axes in panels] == [2] * 6 + [1] * 4  # nothing sees pid's inputs
    assert [axes.get_title(loc="left") for axes in panels[:2]] == ["x of the robot", "Heading"]
    labels = [axes.get_ylabel() for axes in panels[::2]]
    assert labels[:4] == ["kp in 1/s", "ki in 1/s²", "kd, no unit", "scaled error, no unit"]
    colours = [controller_colour(name).light for name in ("fuzzy_t1", "pid")]
    assert [line.get_color() for line in panels[0].lines] == colours


def test_gains_of_a_step_response(study, tuning):
    step = replace(study.steps[0], run=tuning.tracks[0].run)
    names = {name for name, _ in draw_figures(replace(study, tracks=(), steps=(step,)))}
    assert names == DIAGRAMS | {"step_response", "step_gain_history"}


def test_differences_are_drawn_where_there_are_several_seeds(study):
    noisy = study.select("noise")[:3]
    several = [
        replace(r, repeat=k, metrics=r.metrics._replace(me=r.metrics.me + 1e-3 * k * i))
        for k in range(4)
        for i, r in enumerate(noisy)
    ]
    figures = dict(draw_figures(replace(study, tracks=tuple(several), steps=())))
    assert set(figures) == DIAGRAMS | {"noise_xy", "noise_heading", "noise_differences"}
    panels = figures["noise_differences"].axes
    assert [len(axes.patches) for axes in panels] == [3] * 4
    assert "first of 4 seeds" in {
        text.get_text()[16:] for text in figures["noise_xy"].axes[1].texts
    }
    assert len(figures["noise_xy"].axes[2].lines) == 3  # of each controller, the first run


def test_study_without_runs_has_only_diagrams(part):
    assert {name for name, _ in draw_figures(replace(part, tracks=()))} == DIAGRAMS


def test_steps_alone(study):
    steps_only = replace(study, tracks=(), steps=study.steps[:1])
    assert {name for name, _ in draw_figures(steps_only)} == DIAGRAMS | {"step_response"}


def test_a_short_and_perfect_run_can_be_drawn(part):
    result = part.tracks[0]
    there = result.run.target[:3]
    ideal = cut(result.run, 3, pose=there, measured=there)
    figures = dict(draw_figures(replace(part, tracks=(replace(result, run=ideal),))))
    assert "xy_comparison" in figures


def test_controllers_keep_their_colours_and_differ():
    names = ("pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3", "nmpc", "recommended")
    for ground in ("light", "dark"):
        assert len({getattr(controller_colour(name), ground) for name in names}) == len(names)
    assert controller_label("mine") == "mine"
    assert controller_colour("mine") == controller_colour("mine")


@pytest.mark.parametrize("count", [1, 2, 6, 9])
def test_horizons_have_distinct_colours(count):
    inks = horizon_colours(count)
    assert len(set(inks)) == count
    assert all(len(colour) == 7 and colour[0] == "#" for ink in inks for colour in ink)


def test_a_turned_map_is_drawn_where_it_lies():
    """Each cell's colour, where its centre is on the figure."""
    occupied = np.zeros((4, 6), bool)
    occupied[1, 4] = occupied[3, 0] = True
    grid = OccupancyGrid(occupied, 0.5, (2.0, 1.0), yaw=0.6)
    figure = Figure(figsize=(5, 5))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_map(axes, grid, grid, Path(np.array([[2.1, 1.1, 0.0], [2.1, 1.1, 0.0]])))
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[::-1]
    for row, col in np.ndindex(occupied.shape):
        x, y = axes.transData.transform(grid.centre(row, col)).astype(int)
        assert (pixels[y, x, 0] < 128) == occupied[row, col]
    left, right, bottom, top = grid.extent
    assert (axes.get_xlim(), axes.get_ylim()) == ((left, right), (bottom, top))
    assert 0.0 < left < 2.0


def drawn(axes, x, y):
    """The map's image at a point of W: row and column of its pixel, and the red of it."""
    (image,) = axes.images
    u, v = (image.get_transform() - axes.transData).inverted().transform((x, y))
    left, right, bottom, top = image.get_extent()
    rows, cols, _ = image.get_array().shape
    row, col = int((v - bottom) / (top - bottom) * rows), int((u - left) / (right - left) * cols)
    return row, col, int(image.get_array()[row, col, 0])


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_large_map_is_thinned_and_keeps_its_thin_walls(yaw):
    occupied = np.zeros((2999, 2503), bool)
    occupied[1777] = occupied[:, 1234] = True
    grid = OccupancyGrid(occupied, 0.05, (2.0, 1.0), walled=False, yaw=yaw)
    free = grid.inflated(0.6)
    axes = Figure(figsize=(5, 5)).add_subplot()
    draw_map(axes, grid, free, Path(np.array([[2.1, 1.1, 0.0], [2.1, 1.1, 0.0]])))
    rows, cols, _ = axes.images[0].get_array().shape
    assert max(rows, cols) <= 5 * 160
    for row, col in [(1777, 3), (1777, 2502), (0, 1234), (2998, 1234)]:
        assert drawn(axes, *grid.centre(row, col))[2] == 96
    for row, col in [(1785, 3), (1769, 3), (5, 1242)]:
        assert drawn(axes, *grid.centre(row, col))[2] == 228
    for row, col in [(1800, 3), (1750, 3), (5, 1200), (2998, 0), (0, 2502)]:
        assert drawn(axes, *grid.centre(row, col))[2] == 255


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_part_of_a_large_map_is_drawn_cell_by_cell(yaw):
    occupied = np.random.default_rng(1).random((2000, 2000)) < 0.2
    grid = OccupancyGrid(occupied, 0.05, (-30.0, -40.0), yaw=yaw)
    x, y = grid.centre(900, 1100)
    axes = Figure(figsize=(5, 5)).add_subplot()
    way = Path(np.array([[x, y, 0.0], [x, y, 0.0]]))
    draw_map(axes, grid, grid, way, (x - 3.0, x + 3.0, y - 3.0, y + 3.0))
    rows, cols, _ = axes.images[0].get_array().shape
    assert max(rows, cols) < 180
    for row, col in np.random.default_rng(2).integers((860, 1060), (940, 1140), (50, 2)):
        taken = drawn(axes, *grid.centre(int(row), int(col)))[2] < 128
        assert taken == occupied[row, col]
    assert axes.get_xlim() == pytest.approx((x - 3.0, x + 3.0))


def test_a_map_beside_the_view_is_drawn_all_the_same():
    grid = OccupancyGrid(np.ones((5, 5), bool), 1.0)
    axes = Figure(figsize=(5, 5)).add_subplot()
    draw_map(axes, grid, grid, Path(np.zeros((2, 3))), (50.0, 60.0, 50.0, 60.0))
    assert axes.get_xlim() == (50.0, 60.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_kinematic_diagram_shows_every_wheel_of_any_robot(name):
    robot = ROBOTS[name]
    above, wheel = kinematics(robot).axes
    names = [text.get_text() for text in above.texts]
    assert all(str(k + 1) in names for k in range(len(robot.mounts)))
    assert len([p for p in above.patches if isinstance(p, Polygon)]) == len(robot.mounts)
    mecanum = any(mount.roller_angle for mount in robot.mounts)
    assert any("rho" in text.get_text() for text in wheel.texts) == mecanum
