"""The report in a browser: playback, charts, tables, themes, print and hostile names."""

import re
from dataclasses import replace
from io import BytesIO
from time import monotonic

import numpy as np
import pytest
from PIL import Image

from omnidrive.evaluation import Table
from omnidrive.evaluation.page import PageFigure
from omnidrive.evaluation.palette import controller_styles
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_report import StudyReport
from omnidrive.evaluation.verdict import headline
from omnidrive.maps import OccupancyGrid
from omnidrive.simulation import Outcome
from tests.evaluation.recorded import labelled, page_text, reported
from tests.evaluation.synthetic_runs import synthetic_table
from tests.evaluation.truncation import truncated

pytestmark = pytest.mark.browser

HOSTILE = "</script><script>window.hacked=1</script><img src=x onerror='window.hacked=2'>{{data}}"
TABLES = (
    Table("Tracking error", ("Controller", "ME in m", "MAE in rad"), (("NMPC", "0.07", "0.06"),)),
    Table(
        "Steps", ("Controller", "rise in s"), (("NMPC", "0.9"), ("Holonomic NMPC", "0.4")), "Note."
    ),
)


@pytest.fixture(scope="module")
def text_of():
    """Return a function that gives the page of a study, each computed once."""
    known = {}

    def text(results, tables):
        key = id(results), id(tables)
        if key not in known:
            known[key] = results, tables, page_text(reported(results), tables)
        return known[key][-1]

    return text


@pytest.fixture
def visit(show, text_of):
    """Return a function that opens the report; requests and errors fail the test."""

    def opened(results, tables=TABLES, **options):
        return show(results if isinstance(results, str) else text_of(results, tables), **options)

    return opened


def wait_until(page, condition):
    """Poll a condition; the content security policy forbids ``wait_for_function``."""
    deadline = monotonic() + 120.0
    while not page.evaluate(condition):
        assert monotonic() < deadline, condition
        page.wait_for_timeout(20)


def settle(page):
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => setTimeout(done, 30)))")


def map_image(page):
    settle(page)
    return page.locator("#map").screenshot()


def test_play_pause_and_end(study, visit):
    page = visit(study)
    assert not page.evaluate("Playback.playing()")
    assert page.evaluate("Playback.time()") == 5.0  # a quarter of the duration
    before = map_image(page)
    page.select_option("#speed", "8")
    page.click("#play")
    wait_until(page, "Playback.time() > 7")
    page.click("#play")
    time = page.evaluate("Playback.time()")
    assert not page.evaluate("Playback.playing()")
    assert map_image(page) != before
    assert page.evaluate("Playback.time()") == time
    page.locator("#scrub").fill("19.5")
    page.click("#play")
    wait_until(page, "Playback.time() === 20 && !Playback.playing()")


@pytest.mark.long
def test_page_opens_on_a_moving_scene(study, visit):
    page = visit(study, reduced_motion="no-preference")
    assert page.evaluate("Playback.playing()")
    assert page.evaluate("Playback.time()") >= 5.0
    wait_until(page, "Playback.time() > 5.5")
    errors = page.locator("#runs td:nth-child(2)").all_inner_texts()
    assert all(float(text) > 0.0 for text in errors)
    page.get_by_role("radio", name="Track 30 s").check()
    assert page.evaluate("Playback.playing()")
    page.click("#play")
    assert not page.evaluate("Playback.playing()")


def test_page_opens_with_the_verdict(study, visit):
    report = reported(study)
    page = visit(study, report.tables)
    cards = page.locator(".cards li")
    found = report.verdicts
    assert cards.count() == len(found)
    for k, verdict in enumerate(found):
        text = cards.nth(k).inner_text()
        for part in (verdict.name, verdict.best[0], verdict.following.controller,
                     verdict.confidence):  # fmt: skip
            assert part in text
    assert page.inner_text(".lead") == headline(found)
    top, scene = (page.locator(name).bounding_box()["y"] for name in (".lead", "#map"))
    assert top < scene < 800  # both in the window
    colour = page.locator(".cards .swatch").first.evaluate("e => getComputedStyle(e).background")
    r, g, b = (int(controller_styles(study)[found[0].best[0]].colour.light[i : i + 2], 16)
               for i in (1, 3, 5))  # fmt: skip
    assert f"rgb({r}, {g}, {b})" in colour


@pytest.mark.long
def test_errors_have_a_log_scale(study, visit):
    page = visit(study)
    heads = page.locator("#charts .chart strong")
    assert heads.all_inner_texts()[:2] == [
        "Position error in mm",
        "Heading error, absolute in mrad",
    ]
    scales = "uPlot.sync('playback').plots.map(chart => chart.scales.y.distr)"
    linear, logarithmic = 1, 3
    assert page.evaluate(scales) == [logarithmic, logarithmic, linear, linear]
    page.evaluate("Charts.show(5, 10)")
    page.uncheck("#chart-log")
    settle(page)
    assert page.evaluate(scales) == [linear] * 4
    assert heads.all_inner_texts()[:2] == ["Position error in mm", "Heading error in mrad"]
    assert page.evaluate("Charts.span()") == [5, 10]


@pytest.mark.long
def test_values_of_absolute_errors_have_no_sign(study, visit):
    page = visit(study)
    shown = page.locator("#charts .chart").nth(1).locator(".value b")
    run = "Study.groups[0].runs[0]"
    row = page.evaluate(f"{run}.turn.findIndex((turn, k) => k > 0 && turn < -1e-6)")
    page.locator("#scrub").fill(str(page.evaluate(f"{row} * Study.dt")))

    def signs():
        settle(page)
        return {text[0] == "-" for text in shown.all_inner_texts()}

    assert signs() == {False}
    page.uncheck("#chart-log")
    assert True in signs()


@pytest.mark.long
def test_an_open_floor_has_no_obstacles_in_the_legend(study, visit):
    items = ("#obstacle-key", "#inflated-key", "#inflated-layer")
    page = visit(study)
    assert all(page.locator(item).is_visible() for item in items)
    floor = OccupancyGrid(np.zeros((6, 8), bool), 1.0)
    page = visit(replace(study, obstacles=floor, free_space=floor))
    assert not any(page.locator(item).is_visible() for item in items)


@pytest.mark.long
def test_values_from_the_resolution_on_are_not_shown_as_zero(part, visit):
    page = visit(part)
    shown = page.evaluate("[49.62, 3.934, 0.26, 0.000123, -2e-6, 9e-7, 0, NaN].map(Study.text)")
    assert shown == ["49.6", "3.93", "0.260", "1.2e-4", "-2.0e-6", "0", "0", "–"]


@pytest.mark.long
def test_print_is_light_and_fits_the_paper(study, visit, tmp_path):
    page = visit(study, reported(study, published="values").tables, color_scheme="dark")
    corner = "[...document.getElementById('map').getContext('2d').getImageData(2, 2, 1, 1).data]"
    assert max(Image.open(BytesIO(map_image(page))).convert("RGB").getpixel((2, 2))) < 60
    first = "document.querySelector('#runs td').textContent"
    text, colour = page.evaluate(
        f"dispatchEvent(new Event('beforeprint')), [{first}, {corner}]"  # before the next frame
    )
    assert float(text) > 0.0
    assert min(colour[:3]) > 180
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.set_viewport_size({"width": 703, "height": 1000})  # A4 between its margins, 96 px/inch
    page.emulate_media(media="print")
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 703
    for hidden in (".transport", ".map-tools", ".groups", "footer", ".u-over"):
        assert not page.locator(hidden).first.is_visible()
    for shown in (".lead", "#map", "#charts canvas", "#tables table"):
        assert page.locator(shown).first.is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


@pytest.mark.long
def test_rotated_map_is_drawn_at_its_pose(study, visit):
    """Check the colour around the centre of each cell."""
    occupied = np.random.default_rng(2).random((6, 5)) < 0.5
    grid = OccupancyGrid(occupied, 2.0, (4.0, -3.0), yaw=0.5)
    page = visit(replace(study, obstacles=grid, free_space=grid))
    for name in ("trails", "cells"):
        page.locator(f"#layer-{name}").uncheck()
    shown = Image.open(BytesIO(map_image(page))).convert("L")
    for row, col in np.ndindex(occupied.shape):
        x, y = page.evaluate(
            "([x, y]) => Playback.camera.toScreen(x, y)", list(grid.centre(row, col))
        )
        around = np.asarray(shown.crop((int(x) - 8, int(y) - 8, int(x) + 9, int(y) + 9)))
        assert 8 < x < shown.width - 8
        assert (np.median(around) < 160) == occupied[row, col]


@pytest.mark.long
def test_scrub_and_step_by_samples(study, visit):
    page = visit(study)
    page.locator("#scrub").fill("7.5")
    settle(page)
    assert page.inner_text("#clock") == "7.50"
    page.click("#forward")
    page.keyboard.press("Escape")
    page.locator("#map").focus()
    page.keyboard.press("ArrowRight")
    settle(page)
    assert page.inner_text("#clock") == "7.70"
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Home")
    settle(page)
    assert page.inner_text("#clock") == "0.00"
    page.keyboard.press("Space")
    wait_until(page, "Playback.time() > 0")


@pytest.mark.long
def test_zoom_pan_fit_and_follow(study, visit):
    page = visit(study)
    scale = "Playback.camera.scale"
    fitted = page.evaluate(scale)
    pixel = 1.0 / fitted  # m
    box = page.locator("#map").bounding_box()
    x, y = box["x"] + 0.4 * box["width"], box["y"] + 0.4 * box["height"]
    under = "([x, y]) => Playback.camera.toWorld(x, y)"
    at = [0.4 * box["width"], 0.4 * box["height"]]
    before = page.evaluate(under, at)
    page.mouse.move(x, y)
    page.mouse.wheel(0, -600)
    wait_until(page, f"{scale} > {2 * fitted}")
    np.testing.assert_allclose(page.evaluate(under, at), before, atol=pixel)
    page.mouse.down()
    page.mouse.move(x + 80, y + 30, steps=4)
    page.mouse.up()
    np.testing.assert_allclose(page.evaluate(under, [at[0] + 80, at[1] + 30]), before, atol=pixel)
    page.select_option("#follow", label="unicycle-nmpc")
    page.locator("#scrub").fill("10")
    settle(page)
    centre = page.evaluate("[Playback.camera.x, Playback.camera.y]")
    nmpc = next(r for r in study.select("track", duration=20.0) if r.controller == "unicycle-nmpc")
    np.testing.assert_allclose(centre, nmpc.log.pose[100, :2], atol=1e-4)
    page.click("#fit")
    settle(page)
    assert page.evaluate(scale) == pytest.approx(fitted)


@pytest.mark.long
def test_hover_shows_nearest_robot(study, visit):
    page = visit(study)
    page.locator("#scrub").fill("10")
    for k in range(3):
        page.locator("#runs input").nth(k).uncheck()
    page.locator("#map").hover()
    page.wait_for_selector("#tip:not([hidden])")
    tip = page.inner_text("#tip")
    run = study.select("track", duration=20.0)[3].log
    error = 1e3 * np.hypot(*(run.pose[100, :2] - run.target[100, :2]))
    assert "holonomic-nmpc" in tip
    assert "10.00 s" in tip
    assert f"{run.pose[100, 0]:.3f}" in tip
    assert float(re.search(r"([\d.]+) mm", tip)[1]) == pytest.approx(error, abs=0.02)
    page.mouse.move(2, 2)
    page.wait_for_selector("#tip", state="hidden")


def test_charts_share_cursor_zoom_and_time(study, visit):
    page = visit(study)
    charts = page.locator(".u-over")
    assert charts.count() == 4
    charts.first.scroll_into_view_if_needed()
    box = charts.first.bounding_box()
    middle = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + 0.5 * box["width"], middle)
    clocks = page.locator(".chart .clock").all_inner_texts()
    assert clocks == ["t = 10.00 s"] * 4
    page.mouse.click(box["x"] + 0.25 * box["width"], middle)
    settle(page)
    assert page.evaluate("Playback.time()") == pytest.approx(5.0, abs=0.1)
    page.mouse.move(box["x"] + 0.25 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], middle, steps=5)
    page.mouse.up()
    low, high = page.evaluate("Charts.span()")
    assert low == pytest.approx(5.0, abs=0.2)
    assert high == pytest.approx(15.0, abs=0.2)
    page.click("#chart-fit")
    assert page.evaluate("Charts.span()") == [0, 20]


@pytest.mark.long
def test_gain_charts_show_one_channel(tuning, visit):
    page = visit(tuning)
    charts = page.locator("#tuning-charts .chart")
    heads = charts.locator("strong").all_inner_texts()
    assert heads == ["kp in 1/s", "ki in 1/s²", "kd, no unit", "scaled error, no unit",
                     "scaled change of error, no unit"]  # fmt: skip
    page.locator("#scrub").fill("7.5")
    settle(page)
    value = tuning.runs[0].log.details
    shown = charts.nth(0).locator(".value:visible b").all_inner_texts()
    assert shown == [f"{value['kp_x'][75]:.3f}", "5.000"]
    assert charts.nth(3).locator(".value:visible").count() == 1
    page.evaluate("Charts.show(5, 10)")
    page.select_option("#tuning-channel", "heading")
    settle(page)
    assert charts.count() == 5
    shown = charts.nth(0).locator(".value:visible b").all_inner_texts()
    assert shown == [f"{value['kp_heading'][75]:.3f}", "5.000"]
    assert page.evaluate("Charts.span()") == [5, 10]
    over = charts.nth(0).locator(".u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    settle(page)
    assert page.evaluate("Playback.time()") == pytest.approx(7.5, abs=0.1)
    page.locator("#runs input").nth(1).uncheck()
    assert charts.nth(0).locator(".value:visible").count() == 1


@pytest.mark.long
def test_no_gain_charts_without_gains(study, visit):
    assert not visit(study).locator("#tuning").is_visible()


def test_every_group_can_be_selected(study, visit):
    page = visit(study)
    counts = {"Track 20 s": 4, "Track 30 s": 4, "Noise 30 s": 4, "Horizons 20 s": 6,
              "Step response": 4}  # fmt: skip
    assert page.locator("#groups label").all_inner_texts() == list(counts)
    for name, runs in counts.items():
        page.get_by_role("radio", name=name).check()
        settle(page)
        assert page.locator("#runs tr").count() == runs
        assert page.locator("#measured-layer").is_visible() == name.startswith("Noise")


def test_every_table_is_shown(study, visit):
    page = visit(study)
    for table in TABLES:
        shown = page.get_by_role("table", name=table.title)
        assert tuple(shown.locator("thead th").all_inner_texts()) == table.columns
        rows = [
            tuple(r.locator("th, td").all_inner_texts()) for r in shown.locator("tbody tr").all()
        ]
        assert tuple(rows) == table.rows
    assert page.get_by_text("Note.", exact=True).is_visible()


@pytest.mark.long
def test_dark_theme_on_narrow_screen(study, visit):
    page = visit(study, viewport={"width": 390, "height": 844}, color_scheme="dark", has_touch=True)
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    dark = map_image(page)
    page.click("#theme")
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    assert map_image(page) != dark


def test_markup_in_names_is_escaped(study, visit):
    robot = replace(study.robot, name=HOSTILE)
    runs = [labelled(study.select(task)[0], controller=HOSTILE) for task in ("track", "step")]
    hostile = replace(study, title=HOSTILE, plant=HOSTILE, robot=robot, runs=tuple(runs))
    page = visit(hostile, (Table(HOSTILE, (HOSTILE, HOSTILE), ((HOSTILE, HOSTILE),), HOSTILE),))
    page.locator("#map").hover()
    page.wait_for_selector("#tip:not([hidden])")
    assert page.evaluate("window.hacked") is None
    assert page.title() == HOSTILE
    assert page.inner_text("h1") == HOSTILE
    assert page.inner_text("#runs label") == HOSTILE
    assert page.inner_text("#tip strong") == HOSTILE
    assert page.inner_text("#tables tbody td") == HOSTILE
    assert page.locator("img").count() == 0


@pytest.mark.long
def test_early_stop_is_shown(part, visit):
    result = part.runs[0]
    short = truncated(result.log, 50, outcome=Outcome.PLANT_FAILED)
    page = visit(replace(part, runs=(result._replace(log=short), part.runs[1])))
    assert Outcome.PLANT_FAILED.value in page.inner_text("#runs .ended")
    page.locator("#scrub").fill("15")
    settle(page)
    assert page.locator("#runs td.stopped").count() == 3


def evidence_text():
    """Return the report of a study whose names are hostile."""
    table = synthetic_table({HOSTILE: 0.05, "b": 0.06}, repetitions=12, axes={"x": [1.0, 2.0]})
    evidence = StudyEvidence(RunTable(table))
    facts = StudyFacts(HOSTILE, HOSTILE, {"Plant": HOSTILE}, definition=HOSTILE, command=HOSTILE)
    figure = PageFigure(HOSTILE, HOSTILE, b'<svg xmlns="http://www.w3.org/2000/svg"/>')
    return page_text(StudyReport(evidence, facts), figures=[figure])


def test_report_of_a_study_works_offline_in_both_themes(visit):
    page = visit(evidence_text(), viewport={"width": 390, "height": 800})
    assert page.evaluate("window.hacked") is None
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert HOSTILE in page.locator("h1").inner_text()
    before = page.evaluate("document.documentElement.dataset.theme")
    page.click("#theme")
    assert {before, page.evaluate("document.documentElement.dataset.theme")} == {"light", "dark"}
    swatch = page.locator(".swatch").first
    assert swatch.evaluate("e => getComputedStyle(e).backgroundColor") != "rgba(0, 0, 0, 0)"
    assert page.locator("table").count() == 6
