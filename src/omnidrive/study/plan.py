"""A scenario's path by itself: facts about it, and files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnidrive.errors import CannotWrite
from omnidrive.files.bounded_file import one_line
from omnidrive.reference import Reference, TimedReference, save_waypoints, wheel_speed_used
from omnidrive.study.destination import check_picture_name, is_waypoint_file
from omnidrive.study.prepared import Prepared

_SAMPLES = 2001


class Fact(NamedTuple):
    """One thing to say of a plan."""

    value: float | str
    unit: str = ""
    digits: int = 3
    """After the point, for people."""

    def __str__(self) -> str:
        """For people, with the unit."""
        value = self.value if isinstance(self.value, str) else f"{self.value:.{self.digits}f}"
        return f"{value} {self.unit}".rstrip()


def planned_duration(prepared: Prepared) -> float:
    """The scenario's shortest duration, or the robot's if the scenario follows no path; in s."""
    following = prepared.scenario.tasks.following
    return following[0] if following else prepared.shortest


def plan_facts(prepared: Prepared, reference: Reference) -> dict[str, Fact]:
    """What there is to say of a plan, by name.

    Args:
        prepared: The plan.
        reference: It in time, see :meth:`~omnidrive.study.Prepared.reference`.
    """
    found, path = prepared.plan.search_result, prepared.path
    attained, proved = path.max_curvature
    facts = {
        "search": Fact(prepared.scenario.path.search),
        "expansions": Fact(found.expansions, digits=0),
        "search time": Fact(1e3 * found.seconds, "ms"),
        "cells on the way": Fact(len(found.cells), digits=0),
        "length of the way": Fact(prepared.plan.grid_path.length, "m"),
        "smoothing": Fact(prepared.scenario.path.smooth),
        "length": Fact(path.length, "m"),
        "clearance": Fact(prepared.clearance_bounds[0], "m"),
        "largest curvature": Fact(attained if np.isinf(proved) else proved, "1/m"),
        "timing": Fact(prepared.scenario.timing.law),
        "shortest duration": Fact(prepared.shortest, "s"),
        "duration": Fact(reference.duration, "s"),
        "mean speed": Fact(path.length / reference.duration, "m/s"),
        **{
            f"{name} used": Fact(100.0 * share, "%", 1)
            for name, share in _limit_usage(prepared, reference).items()
        },
    }
    return facts | ({"note": Fact(prepared.note)} if prepared.note else {})


def _limit_usage(prepared: Prepared, reference: Reference) -> dict[str, float]:
    """Peak share of every limit that the reference uses, by name."""
    if isinstance(reference, TimedReference):
        return reference.limit_usage
    share = wheel_speed_used(prepared.path, reference.duration, prepared.robot.chassis)
    return {"wheel speed": share}


def save_figure(prepared: Prepared, reference: Reference, path: Path) -> None:
    """Draw map, way, path and headings, and below them the speeds over time: PNG or SVG.

    Raises:
        InvalidInput: The name has another ending.
        CannotWrite: The file cannot be written.
    """
    from omnidrive.evaluation.figures import plan_figure, save  # noqa: PLC0415 - takes a second

    check_picture_name(path)
    times = np.linspace(0.0, reference.duration, _SAMPLES)
    figure = plan_figure(
        prepared.obstacles,
        prepared.plan.free_space,
        prepared.plan.grid_path,
        times,
        _window(reference),
    )
    try:
        save(figure, path)
    except OSError as error:
        raise CannotWrite(
            f"cannot write to {one_line(str(path))}: {error.strerror or error}"
        ) from None


def save_plan(prepared: Prepared, reference: Reference, path: Path) -> None:
    """Write the reference to a waypoint file, one row per sample time, or a whole folder.

    Args:
        prepared: The plan.
        reference: It in time.
        path: A waypoint file, or else a new folder for scenario.yaml, reference.csv and path.png.

    Raises:
        InvalidInput: The name ends as that of another kind of file.
        CannotWrite: The file or folder cannot be made, or the folder holds something already.
    """
    if is_waypoint_file(path):
        save_waypoints(path, reference, dt=prepared.scenario.sample_time)
        return
    from omnidrive.study.folder import RunFolder  # noqa: PLC0415 - takes a second

    RunFolder(path).save_demand(prepared)
    save_waypoints(path / "reference.csv", reference, dt=prepared.scenario.sample_time)
    save_figure(prepared, reference, path / "path.png")


def _window(reference: Reference) -> np.ndarray:
    """Setpoints at equal times over the whole reference."""
    return reference.window(0.0, _SAMPLES, reference.duration / (_SAMPLES - 1))
