"""Results of planning a motion: facts for display, figures and waypoint files."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.plan_view import PlanView
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.planning import FootprintPlan, SplinePath
from omnidrive.planning.footprint import PoseSearchResult
from omnidrive.reference import (
    LimitedReference,
    Reference,
    limit_usage,
    sample_within_limits,
    save_waypoints,
    top_speed,
    wheel_speed_used,
)
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.study.output_paths import check_figure_name, check_page_name, is_waypoint_file

_SAMPLES = 2001
_VIEW_SAMPLES = 1001  # of the page, whose size is bounded
_CORNERS = 41  # of a circle around the robot


class Fact(NamedTuple):
    """One named result of planning."""

    value: float | str
    unit: str = ""
    digits: int = 3
    """Decimals of a number in text output."""

    def __str__(self) -> str:
        """Format the value with its unit."""
        value = self.value if isinstance(self.value, str) else f"{self.value:.{self.digits}f}"
        return f"{value} {self.unit}".rstrip()


def planned_duration(planned: PlannedScenario) -> float:
    """Return the first duration of the path in the tasks, in s; if there is none, the shortest."""
    durations = planned.scenario.tasks.path_durations
    return durations[0] if durations else planned.natural or planned.shortest


def plan_facts(
    planned: PlannedScenario, reference: Reference, *, is_limited: bool = False
) -> dict[str, Fact]:
    """Return the results of planning, by name.

    Args:
        planned: The planned scenario.
        reference: The motion along the path.
        is_limited: Whether a time limit held, so that the results have a status.
    """
    path = planned.path
    facts = {
        **_search_facts(planned),
        **(_status_facts(planned) if is_limited else {}),
        "length": Fact(path.length, "m"),
        "clearance": Fact(planned.clearance_bounds[0], "m"),
    }
    if planned.scenario.map.source == "none":
        facts["clearance"] = Fact("no obstacles")
    if isinstance(path, SplinePath):
        attained, proved = path.max_curvature
        facts["largest curvature"] = Fact(attained if np.isinf(proved) else proved, "1/m")
        facts["its largest rate"] = Fact(path.max_curvature_rate, "1/m^2")
        facts["timing"] = Fact(planned.scenario.timing.law)
    facts |= {
        "shortest duration": Fact(planned.shortest, "s"),
        "duration": Fact(reference.duration, "s"),
        "mean speed": Fact(path.length / reference.duration, "m/s"),
        **{
            f"{name} used": Fact(100.0 * share, "%", 1)
            for name, share in _limit_usage(planned, reference).items()
        },
    }
    return facts | ({"note": Fact(planned.note)} if planned.note else {})


def _status_facts(planned: PlannedScenario) -> dict[str, Fact]:
    """Return how far search and smoothing of a planned path got within a time limit."""
    if planned.plan is None:
        return {}
    facts = {"status": Fact(planned.plan.status)}
    if planned.plan.status == "not optimal":
        facts["cost at most"] = Fact(planned.plan.suboptimality, "times the least")
    return facts


def _search_facts(planned: PlannedScenario) -> dict[str, Fact]:
    """Return the facts on search and smoothing, or the name of another reference."""
    if planned.plan is None:
        assert planned.scenario.reference != "path"
        return {"reference": Fact(planned.scenario.reference.type)}
    found = planned.plan.search_result
    shape = {}
    if isinstance(planned.plan, FootprintPlan):
        shape = {"shape": Fact(planned.plan.shape), "reason": Fact(planned.plan.reason)}
    if isinstance(found, PoseSearchResult):
        return {
            **shape,
            "search": Fact("A* over cells and 72 headings"),
            "expansions": Fact(found.expansions, digits=0),
            "search time": Fact(1e3 * found.seconds, "ms"),
            "poses of search": Fact(len(found.poses), digits=0),
            "length of search": Fact(planned.plan.grid_path.length, "m"),
        }
    return {
        **shape,
        "search": Fact(planned.scenario.path.search),
        "expansions": Fact(found.expansions, digits=0),
        "search time": Fact(1e3 * found.seconds, "ms"),
        "cells of grid path": Fact(len(found.cells), digits=0),
        "length of grid path": Fact(planned.plan.grid_path.length, "m"),
        "smoothing": Fact(planned.scenario.path.smooth),
    }


def _limit_usage(planned: PlannedScenario, reference: Reference) -> dict[str, float]:
    """Return the peak use of every limit by the reference, as a share of the limit, by name."""
    if isinstance(reference, LimitedReference):
        return reference.limit_usage
    if isinstance(planned.path, SplinePath):
        duration, top = reference.duration, planned.scenario.timing.max_speed
        share = wheel_speed_used(planned.path, duration, planned.robot.chassis)
        of_speed = {} if top is None else {"speed": top_speed(planned.path, duration) / top}
        return {"wheel speed": share, **of_speed}
    return limit_usage(reference, planned.limits)


def save_figure(planned: PlannedScenario, reference: Reference, path: StrPath) -> None:
    """Draw map, grid path, path and headings, and the speeds over time, as PNG or SVG.

    Raises:
        InvalidInput: The file name has another suffix.
        CannotWrite: The file cannot be written.
    """
    from omnidrive.evaluation.figures import plan_figure, save  # noqa: PLC0415 - takes a second

    path = to_path(path)
    check_figure_name(path)
    times = np.linspace(0.0, reference.duration, _SAMPLES)
    angles = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    outline = planned.robot.outline
    figure = plan_figure(
        planned.obstacles,
        planned.free_space,
        planned.plan.grid_path if planned.plan else None,
        times,
        _window(reference),
        costs=planned.plan.costs if planned.plan else None,
        outline=planned.robot.body_radius * circle if outline is None else np.array(outline),
    )
    save(figure, path)


def plan_view(planned: PlannedScenario, reference: Reference) -> PlanView:
    """Return the motion on its map, at 1001 equally spaced times.

    Args:
        planned: The planned scenario.
        reference: The motion along the path.
    """
    times = np.linspace(0.0, reference.duration, _VIEW_SAMPLES)
    motion = reference.window(0.0, _VIEW_SAMPLES, reference.duration / (_VIEW_SAMPLES - 1))
    return PlanView(
        planned.robot,
        planned.obstacles,
        planned.free_space,
        planned.plan.grid_path if planned.plan else None,
        times,
        motion,
        planned.clearances(motion[:, None, :3]),
        planned.limits,
        planned.plan.costs if planned.plan else None,
    )


def save_plan_page(planned: PlannedScenario, reference: Reference, path: StrPath) -> None:
    """Write a self-contained HTML page with the motion on its map and the results of planning.

    Raises:
        InvalidInput: The file name has another suffix.
        CannotWrite: The file cannot be written.
    """
    from omnidrive.evaluation.page import PlanPage  # noqa: PLC0415 - takes a second

    path = to_path(path)
    check_page_name(path)
    facts = {name: str(fact) for name, fact in plan_facts(planned, reference).items()}
    page = PlanPage(planned.scenario.name, facts, plan_view(planned, reference))
    with output_file(path) as part:
        part.write_text(page.text(), encoding="utf-8", errors="backslashreplace")


def save_plan(planned: PlannedScenario, reference: Reference, path: StrPath) -> None:
    """Write the reference to a waypoint file or to a folder.

    There is one row per sample time, and further rows where the limits would otherwise be exceeded
    by more than 1 % between rows; see :func:`~omnidrive.reference.sample_within_limits`.

    Args:
        planned: The planned scenario.
        reference: The motion along the path.
        path: A waypoint file, or a new folder for scenario.yaml, reference.csv, path.png
            and path.html.

    Raises:
        InvalidInput: The suffix is that of another kind of file.
        CannotWrite: The file or folder cannot be created, or the folder is not empty.
    """
    path = to_path(path)
    if is_waypoint_file(path):
        _save_motion(planned, reference, path)
        return
    from omnidrive.study.folder import RunFolder  # noqa: PLC0415 - takes a second

    RunFolder(path).save_inputs(planned)
    _save_motion(planned, reference, path / "reference.csv")
    save_figure(planned, reference, path / "path.png")
    save_plan_page(planned, reference, path / "path.html")


def _save_motion(planned: PlannedScenario, reference: Reference, path: StrPath) -> None:
    dt = planned.scenario.sample_time
    if isinstance(reference, LimitedReference):  # it has limits of its own
        zones = planned.plan.costs if planned.plan else None
        save_waypoints(path, reference, dt=dt, zones=zones)
        return
    usage = _limit_usage(planned, reference)
    save_waypoints(path, sample_within_limits(reference, dt, planned.limits, usage))


def _window(reference: Reference) -> np.ndarray:
    """Return setpoints at equally spaced times over the whole reference."""
    return reference.window(0.0, _SAMPLES, reference.duration / (_SAMPLES - 1))
