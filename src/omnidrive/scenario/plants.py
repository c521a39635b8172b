"""The plants of a study."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from omnidrive import visualization  # imports only the modules in use
from omnidrive.components import configure
from omnidrive.errors import PART_ERRORS, one_line
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.simulation import MovingObstacle, Plant
from omnidrive.simulation.components import PlantContext

_log = logging.getLogger(__name__)


def make_plant(
    robot: Robot,
    name: str,
    *,
    rng: np.random.Generator | None = None,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
    **parameters: Any,
) -> Plant:
    """Return a new plant; the caller closes it. Arguments that do not apply to it are ignored.

    Args:
        robot: The simulated robot.
        name: Name of the plant, or of code such as ``mine.py:MyPlant``.
        rng: Generator of the initial wheel angles, uniform in one roller pitch, for plants with
            rollers. None: 0 rad.
        obstacles: Map around the robot. None: an unbounded floor without obstacles.
        moving: Moving obstacles.
        parameters: Parameters of the plant.

    Raises:
        InvalidInput: There is no such plant, or it cannot be imported.
        pydantic.ValidationError: A parameter is unknown, or its value is invalid.
    """
    context = PlantContext(robot, rng, obstacles, tuple(moving))
    plant: Plant = configure("plants", name, parameters).make(context)
    return plant


def _close(plant: Plant) -> None:
    """Close a plant; an exception is logged, and the results of its run are kept."""
    try:
        plant.close()
    except PART_ERRORS as error:
        _log.warning("the plant cannot be closed: %s", one_line(f"{type(error).__name__}: {error}"))


def new_plant(planned: PlannedScenario, repeat: int = 0, *, on_map: bool = True) -> Plant:
    """Return a new plant of a scenario; the caller closes it. Arguments: see :func:`plant_of`."""
    scenario = planned.scenario
    # independent of the random numbers of the noise
    seed = np.random.SeedSequence(scenario.seed, spawn_key=(repeat,))
    obstacles = planned.obstacles if on_map else None
    moving = _moving_obstacles(planned) if on_map else ()
    rng = np.random.default_rng(seed) if scenario.true_robot.roller_phase else None
    plant: Plant = scenario.plant.make(PlantContext(planned.plant_robot, rng, obstacles, moving))
    return plant


def _moving_obstacles(planned: PlannedScenario) -> tuple[MovingObstacle, ...]:
    return tuple(section.obstacle() for section in planned.scenario.map.moving)


@contextmanager
def plant_of(
    planned: PlannedScenario,
    reference: Reference,
    repeat: int = 0,
    *,
    on_map: bool = True,
    observers: Sequence[visualization.Observer] = (),
) -> Iterator[Plant]:
    """Yield the plant of a scenario, and close it at the end.

    Args:
        planned: The planned scenario.
        reference: The motion to track, for the observers.
        repeat: Index of the repeat, from 0; part of the seed of the random numbers.
        on_map: Whether the plant contains the obstacles of the map; otherwise an unbounded floor.
        observers: Observers of the run.
    """
    plant = new_plant(planned, repeat, on_map=on_map)
    obstacles = planned.obstacles if on_map else None
    moving = _moving_obstacles(planned) if on_map else ()
    try:
        if not observers:
            yield plant
            return
        yield visualization.observe(
            plant, planned.plant_robot, reference, observers, obstacles=obstacles, moving=moving
        )
    finally:
        _close(plant)
