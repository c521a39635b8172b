"""Robots and pipelines of scenarios, for drives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from omnidrive.control import Pipeline
from omnidrive.deploy.links.simulated import SimulatedRobot
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.plants import new_plant
from omnidrive.scenario.run_parts import (
    make_controller,
    make_estimator,
    make_sensors,
    make_supervisor,
)

_ANY_AGE = 1e6  # s; the largest limit of a scenario


@dataclass(frozen=True, slots=True)
class ScenarioRobot:
    """A function that makes plant and sensors of a scenario, also in another process.

    Attributes:
        planned: The planned scenario.
        noise: Whether the pose fixes have the noise of the paper. The estimator assumes it with the
            scenario of :func:`with_paper_noise`.
    """

    planned: PlannedScenario
    noise: bool = False

    def __call__(self) -> SimulatedRobot:
        """Return new plant and sensors, with the random numbers of the scenario's seed."""
        planned, scenario = self.planned, self.planned.scenario
        sensors = make_sensors(
            scenario, planned.robot, np.random.default_rng([scenario.seed, 0]), noise=self.noise
        )
        return SimulatedRobot(planned.plant_robot, new_plant(planned), sensors)


def with_paper_noise(planned: PlannedScenario) -> PlannedScenario:
    """Return the scenario with the noise of the paper in the pose fixes of its sensors section.

    Simulated sensors and estimators, also in replays of its logs, then have the same settings.
    Without the section the scenario is unchanged: there is no estimator.
    """
    section = planned.scenario.sensors
    if section is None:
        return planned
    scenario = planned.scenario.model_copy(update={"sensors": section.with_paper_noise()})
    return replace(planned, scenario=scenario)


def without_pose_fixes(planned: PlannedScenario) -> PlannedScenario:
    """Return the scenario for a link that measures no pose: pose fixes may be of any age.

    The watchdog's limit of the standard deviation, which grows as the estimator reckons, remains.
    """
    watchdog = planned.scenario.watchdog.model_copy(update={"age": _ANY_AGE})
    scenario = planned.scenario.model_copy(update={"watchdog": watchdog})
    return replace(planned, scenario=scenario)


def component_names(planned: PlannedScenario, label: str) -> dict[str, str]:
    """Return the names of the controller and the estimator of :func:`scenario_pipeline`."""
    sensors = planned.scenario.sensors
    estimator = None if sensors is None else sensors.estimator
    return {
        "controller": planned.scenario.controllers[label].type,
        "estimator": "none" if estimator is None else estimator.type,
    }


def scenario_pipeline(planned: PlannedScenario, label: str) -> Pipeline:
    """Return a new pipeline of a scenario: its estimator, supervisor and one controller.

    Args:
        planned: The planned scenario.
        label: Label of the controller.
    """
    scenario, robot = planned.scenario, planned.robot
    rng = np.random.default_rng([scenario.seed, 1])
    sensors = make_sensors(scenario, robot, np.random.default_rng(0))
    return Pipeline(
        make_controller(scenario, robot, label, rng=rng),
        make_estimator(scenario, robot, sensors),
        make_supervisor(scenario, robot),
    )
