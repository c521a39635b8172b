"""The plants of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation import (
    CoppeliaSimPlant,
    CoppeliaSimScene,
    KinematicPlant,
    MovingObstacle,
    MujocoPlant,
    PlanarPlant,
    Plant,
)
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.scenario import PlantName
from omnidrive.visualization import Observer, observe


def make_plant(
    robot: Robot,
    name: PlantName,
    *,
    rng: np.random.Generator | None = None,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
    scene: CoppeliaSimScene | None = None,
) -> Plant:
    """Return a new plant; the caller closes it. Arguments that do not apply to it are ignored.

    Args:
        robot: The simulated robot.
        name: Name of the plant.
        rng: Generator of the initial angles of the rollers. None: equal angles.
        obstacles: Map around the robot. None: an unbounded floor without obstacles.
        moving: Moving obstacles.
        scene: Connection to CoppeliaSim and names of the objects in its scene.
    """
    table: dict[PlantName, Callable[[], Plant]] = {
        "kinematic": lambda: KinematicPlant(robot),
        "planar": lambda: PlanarPlant(robot, rng),
        "mujoco-balls": lambda: MujocoPlant(robot, "ball", obstacles=obstacles, moving=moving),
        "mujoco-rollers": lambda: MujocoPlant(
            robot, "rollers", rng, obstacles=obstacles, moving=moving
        ),
        "coppeliasim": lambda: CoppeliaSimPlant(robot, scene),
    }
    return table[name]()


@contextmanager
def plant_of(
    planned: PlannedScenario,
    reference: Reference,
    repeat: int = 0,
    *,
    on_map: bool = True,
    observers: Sequence[Observer] = (),
) -> Iterator[Plant]:
    """Yield the plant of a scenario, and close it at the end.

    Args:
        planned: The planned scenario.
        reference: The motion to track, for the observers.
        repeat: Index of the repeat, from 0; part of the seed of the random numbers.
        on_map: Whether the plant contains the obstacles of the map; otherwise an unbounded floor.
        observers: Observers of the run.
    """
    scenario = planned.scenario
    # independent of the random numbers of the noise
    seed = np.random.SeedSequence(scenario.seed, spawn_key=(repeat,))
    obstacles = planned.obstacles if on_map else None
    moving = [section.obstacle() for section in scenario.map.moving] if on_map else []
    plant = make_plant(
        planned.robot,
        scenario.plant,
        rng=np.random.default_rng(seed) if scenario.robot.roller_phase else None,
        obstacles=obstacles,
        moving=moving,
        scene=CoppeliaSimScene(**scenario.coppeliasim.model_dump()),
    )
    try:
        yield observe(
            plant, planned.robot, reference, observers, obstacles=obstacles, moving=moving
        )
    finally:
        plant.close()
