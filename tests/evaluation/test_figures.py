"""Figures of a study: which are drawn, what they show, and their files."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.patches import Polygon
from matplotlib.text import Text
from PIL import Image

from omnidrive.evaluation.figures import catalogue, save
from omnidrive.evaluation.figures.catalogue import log_drawings
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.evaluation.figures.plan import draw_map
from omnidrive.evaluation.figures.style import DPI, register_fonts
from omnidrive.evaluation.measures.metrics import measure
from omnidrive.evaluation.palette import controller_styles
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path
from omnidrive.robot import ROBOTS
from tests.evaluation.recorded import labelled, reported, with_metrics
from tests.evaluation.truncation import truncated

WITHOUT_FUZZY = {"kinematics", "tracking_error"}
"""Diagrams of a study without fuzzy controllers."""
DIAGRAMS = WITHOUT_FUZZY | {"membership_functions"}
ALL = DIAGRAMS | {
    "xy_comparison",
    "heading_comparison",
    "horizon_xy",
    "horizon_heading",
    "horizon_bars",
    "step_response",
    "effort",
    "noise_xy",
    "noise_heading",
}

KINDS = ("kinematics", "xy_comparison", "heading_comparison", "horizon_bars", "step_response",
         "effort")  # fmt: skip


def draw_figures(logs):
    """Return name and figure of every figure of logs."""
    drawn = ((name, catalogue.drawn(each)) for name, each in log_drawings(logs).items())
    return [(name, figure) for name, figure in drawn if figure is not None]


def draw_figure(logs, name):
    return catalogue.draw_figure(log_drawings(logs), name)


def write_figures(known, folder, **formats):
    """Write figures; return the files."""
    return [path for _, path in catalogue.write_figures(known, folder, **formats)]


@pytest.fixture(scope="module", params=["kinds", pytest.param("all", marks=pytest.mark.long)])
def figures(study, request):
    """A figure of every kind, or every figure of the study, drawn on a canvas of pixels."""
    if request.param == "all":
        found = dict(draw_figures(study))
        assert set(found) == ALL
    else:
        found = {name: draw_figure(study, name) for name in KINDS}
    for figure in found.values():
        FigureCanvasAgg(figure).draw()
    return found


@pytest.fixture(scope="module")
def files(study, figures, tmp_path_factory):
    """The figures as SVG, two of them also as PDF."""
    folder = tmp_path_factory.mktemp("figures") / "made"
    drawings = log_drawings(study)
    known = {n: drawings[n]._replace(draw=lambda f=f: f) for n, f in figures.items()}
    some = {name: known[name] for name in ("kinematics", "xy_comparison")}
    return write_figures(known, folder) + write_figures(some, folder, formats=("pdf",))


def test_images_are_not_blank(figures):
    for name, figure in figures.items():
        assert min(figure.get_size_inches()) * DPI > 300, name
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
        assert pixels.mean(axis=2).std() > 5.0, name


def test_every_figure_is_written(figures, files):
    written = {f"{name}.svg" for name in figures} | {"kinematics.pdf", "xy_comparison.pdf"}
    assert {path.name for path in files} == written


def test_svg_files_are_self_contained_and_undated(files):
    for path in files:
        if path.suffix == ".svg":
            text = path.read_text(encoding="utf-8")
            root = ElementTree.fromstring(text)
            links = [v for e in root.iter() for k, v in e.attrib.items() if k.endswith("href")]
            assert all(link.startswith(("#", "data:")) for link in links), path.name
            assert "dc:date" not in text
            assert len(list(root.iter())) > 50, path.name


@pytest.mark.long
def test_output_is_deterministic(part, tmp_path):
    once, again = (
        [path.read_bytes() for path in write_figures(log_drawings(part), tmp_path / name)]
        for name in "ab"
    )
    assert once == again


def test_figures_without_runs_are_omitted(part):
    names = {name for name, _ in draw_figures(part)}
    assert names == WITHOUT_FUZZY | {"xy_comparison", "heading_comparison", "effort"}


def test_gain_history_of_logged_gains(tuning):
    figures = dict(draw_figures(tuning))
    assert set(figures) - DIAGRAMS == {
        "xy_comparison",
        "heading_comparison",
        "effort",
        "gain_history",
    }
    panels = figures["gain_history"].axes
    assert len(panels) == 5 * 2
    assert [len(axes.lines) for axes in panels] == [2] * 6 + [1] * 4  # pid has no fuzzy inputs
    assert [axes.get_title(loc="left") for axes in panels[:2]] == ["x of the robot", "Heading"]
    labels = [axes.get_ylabel() for axes in panels[::2]]
    assert labels[:4] == ["kp in 1/s", "ki in 1/s²", "kd, no unit", "scaled error, no unit"]
    styles = controller_styles(tuning)
    colours = [styles[name].colour.light for name in ("fuzzy_t1", "pid")]
    assert [line.get_color() for line in panels[0].lines] == colours


def test_gain_history_of_step_response(study, tuning):
    step = study.select("step")[0]._replace(log=tuning.runs[0].log)
    names = {name for name, _ in draw_figures(replace(study, runs=(step,)))}
    assert names == DIAGRAMS | {"step_response", "step_gain_history"}


def test_figures_of_several_seeds(study):
    noisy = study.select("noise")[:3]
    records = [
        with_metrics(labelled(r, repeat=k), me=r.record.metrics["me"] + 1e-3 * k * i).record
        for k in range(7)
        for i, r in enumerate(noisy)
    ]
    report = reported(replace(study, runs=noisy, repeats=7), records)
    figures = {n: f for n, d in report.figures.items() if (f := catalogue.drawn(d)) is not None}
    assert set(figures) - DIAGRAMS == {
        "noise_xy", "noise_heading", "effort", "distributions", "pairs", "cost",
    }  # fmt: skip
    titles = [axes.get_xlabel() for axes in figures["pairs"].axes]
    assert titles == [
        f"difference of {name}"
        for name in ("ME in mm", "ME measured in mm", "MAE in mrad", "MAE measured in mrad")
    ]
    assert "first of 7 seeds" in {
        text.get_text()[16:] for text in figures["noise_xy"].axes[1].texts
    }
    assert len(figures["noise_xy"].axes[2].lines) == 3  # the first run of each controller


def test_study_without_runs_has_only_diagrams(part):
    assert {name for name, _ in draw_figures(replace(part, runs=()))} == WITHOUT_FUZZY


def test_steps_alone(study):
    steps_only = replace(study, runs=study.select("step")[:1])
    assert {name for name, _ in draw_figures(steps_only)} == DIAGRAMS | {"step_response"}


def test_short_run_without_error_is_drawn(part):
    result = part.runs[0]
    there = result.log.target[:3]
    ideal = truncated(result.log, 3, pose=there, measured=there)
    draw_figure(replace(part, runs=(result._replace(log=ideal),)), "xy_comparison")


def test_rotated_map_is_drawn_at_its_pose():
    """Check the colour at the centre of each cell."""
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
    """Return row, column and red value of the map image at a point in W."""
    (image,) = axes.images
    u, v = (image.get_transform() - axes.transData).inverted().transform((x, y))
    left, right, bottom, top = image.get_extent()
    rows, cols, _ = image.get_array().shape
    row, col = int((v - bottom) / (top - bottom) * rows), int((u - left) / (right - left) * cols)
    return row, col, int(image.get_array()[row, col, 0])


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_downsampled_map_keeps_thin_walls(yaw):
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
def test_section_of_large_map_is_drawn_at_full_resolution(yaw):
    occupied = np.random.default_rng(1).random((2000, 2000)) < 0.2
    grid = OccupancyGrid(occupied, 0.05, (-30.0, -40.0), yaw=yaw)
    x, y = grid.centre(900, 1100)
    axes = Figure(figsize=(5, 5)).add_subplot()
    grid_path = Path(np.array([[x, y, 0.0], [x, y, 0.0]]))
    draw_map(axes, grid, grid, grid_path, (x - 3.0, x + 3.0, y - 3.0, y + 3.0))
    rows, cols, _ = axes.images[0].get_array().shape
    assert max(rows, cols) < 180
    for row, col in np.random.default_rng(2).integers((860, 1060), (940, 1140), (50, 2)):
        occupied_pixel = drawn(axes, *grid.centre(int(row), int(col)))[2] < 128
        assert occupied_pixel == occupied[row, col]
    assert axes.get_xlim() == pytest.approx((x - 3.0, x + 3.0))


def test_map_outside_the_view():
    grid = OccupancyGrid(np.ones((5, 5), bool), 1.0)
    axes = Figure(figsize=(5, 5)).add_subplot()
    draw_map(axes, grid, grid, Path(np.zeros((2, 3))), (50.0, 60.0, 50.0, 60.0))
    assert axes.get_xlim() == (50.0, 60.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_kinematic_diagram_shows_every_wheel(name):
    robot = ROBOTS[name]
    above, wheel = kinematics(robot).axes
    names = [text.get_text() for text in above.texts]
    assert all({str(k), f"$v_{k}$"} <= set(names) for k in range(len(robot.mounts)))
    assert len([p for p in above.patches if isinstance(p, Polygon)]) == len(robot.mounts)
    mecanum = any(mount.roller_angle for mount in robot.mounts)
    assert any("rho" in text.get_text() for text in wheel.texts) == mecanum


def test_effort_shows_speeds_of_every_wheel(study, figures):
    panels = figures["effort"].axes
    assert [axes.get_ylabel() for axes in panels[:8:2]] == [f"wheel {i}" for i in range(4)]
    runs = study.select("track", duration=20.0)
    for i in range(4):
        for line, result in zip(panels[2 * i + 1].lines, runs, strict=True):
            late = result.log.t >= 2.0
            np.testing.assert_array_equal(line.get_ydata(), result.log.wheel_speed[late, i])
    assert [axes.get_visible() for axes in panels[-2:]] == [True, False]  # the plant has no forces


def test_effort_of_commanded_wheel_speeds_and_torques(part):
    chassis = part.robot.drive
    run = part.runs[0].log
    speeds = run.command @ chassis.jacobian.T
    twists = np.full_like(run.command, np.nan)
    by_wheels = replace(run, command=twists, wheel_speed_command=speeds)
    same = (measure(each, chassis).wheel_acceleration for each in (run, by_wheels))
    assert len(set(same)) == 1
    by_torques = replace(run, command=twists, wheel_torque_command=speeds)
    assert np.isnan(measure(by_torques, chassis).wheel_acceleration)
    result = part.runs[0]._replace(log=by_torques)
    draw_figure(replace(part, runs=(result,)), "effort")


def test_figures_have_the_widths_of_journal_columns(figures):
    for name, figure in figures.items():
        width, height = figure.get_size_inches()
        assert width in {3.5, 7.16}, name
        assert height < 9.0, name


def test_errors_have_log_scales_and_curves_the_labels_of_the_controllers(part):
    paths = draw_figure(part, "xy_comparison").axes
    headings = draw_figure(part, "heading_comparison").axes
    assert (paths[2].get_yscale(), headings[1].get_yscale()) == ("log", "symlog")
    for axes in (paths[0], headings[0]):
        labels = axes.get_legend_handles_labels()[1]
        others = {"Grid path", "Reference"}
        assert [name for name in labels if name not in others] == list(part.controllers)


def test_text_in_files_is_text(files):
    for path in files:
        if path.suffix == ".svg":
            text = "".join(ElementTree.parse(path).getroot().itertext())
            assert ("time in s" in text) == (path.stem in ALL - DIAGRAMS - {"horizon_bars"})
        else:
            data = path.read_bytes()
            assert data.startswith(b"%PDF-")
            assert b"/Subtype /Type3" not in data  # bitmaps of glyphs; journals reject them
            assert b"/FontFile2" in data


def test_equal_curves_are_both_visible(study):
    """Two controllers with the same run: each colour covers pixels of the error panel."""
    first = study.select("track", duration=20.0)[0]
    twin = labelled(first, controller="fuzzy_t2")
    figure = draw_figure(replace(study, runs=(first, twin)), "xy_comparison")
    canvas = FigureCanvasAgg(figure)
    figure.set_dpi(150)
    canvas.draw()
    box = figure.axes[2].get_window_extent()
    pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(int)
    panel = pixels[int(box.y0) : int(box.y1), int(box.x0) : int(box.x1)]
    styles = controller_styles(study)
    for name in ("fuzzy_t1", "fuzzy_t2"):
        colour = [int(styles[name].colour.light[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(panel - colour).max(axis=2) < 40).sum() > 100, name


def test_missing_fonts_of_the_font_cache_are_added(monkeypatch):
    system = [f for f in fontManager.ttflist if f.name == "DejaVu Sans"]
    elsewhere = replace(system[0], fname="/usr/share/fonts/DejaVuSans.ttf")
    monkeypatch.setattr(fontManager, "ttflist", [elsewhere])
    register_fonts.cache_clear()
    register_fonts()
    assert {"STIXGeneral", "cmr10", "DejaVu Sans"} <= {f.name for f in fontManager.ttflist}


def precise(study, share):
    """Return the study with headings of all runs at a share of their errors."""

    def changed(result):
        run = result.log
        pose = run.pose.copy()
        pose[:, 2] = run.target[:, 2] + share * (run.pose[:, 2] - run.target[:, 2])
        return result._replace(log=replace(run, pose=pose))

    return replace(study, runs=tuple(map(changed, study.runs)))


@pytest.mark.parametrize("share", [1.0, 1e-3, 1e-12])
def test_ticks_of_heading_errors_are_short_numbers(study, share):
    figure = draw_figure(precise(study, share), "heading_comparison")
    figure.canvas.draw()
    labels = [t.get_text() for t in figure.axes[1].get_yticklabels()]
    assert len(labels) >= 3
    assert all(len(label) <= 7 for label in labels), labels


def test_titles_are_within_their_figures(study, figures):
    small = draw_figure(precise(study, 1e-3), "heading_comparison")
    small.canvas.draw()
    for name, figure in (*figures.items(), ("small errors", small)):
        for axes in figure.axes:
            titles = {axes.get_title(loc=where) for where in ("left", "center", "right")} - {""}
            for each in axes.get_children():
                if isinstance(each, Text) and each.get_text() in titles:
                    box = each.get_window_extent()
                    assert box.x0 >= 0.0, (name, each)
                    assert box.x1 <= figure.bbox.width, (name, each)


def test_figure_is_drawn_once_per_file_and_its_texts_are_within_it(part, tmp_path, monkeypatch):
    drawn, draw = [], Figure.draw
    monkeypatch.setattr(
        Figure, "draw", lambda figure, renderer: (drawn.append(figure), draw(figure, renderer))
    )
    figure = draw_figure(part, "xy_comparison")
    for suffix in ("svg", "png"):
        save(figure, tmp_path / f"figure.{suffix}")
    assert drawn == [figure, figure]
    with Image.open(tmp_path / "figure.png") as image:
        assert image.size == tuple((DPI * figure.get_size_inches()).astype(int))
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert 0.03 < box.x0 < box.x1 < width - 0.03
    assert 0.03 < box.y0 < box.y1 < height - 0.03
