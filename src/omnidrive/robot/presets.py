"""Robots of this package, and robots by name or file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import ClassVar

from omnidrive.components import component_names, find_component
from omnidrive.errors import InvalidInput, kind_of, one_line, suggestion
from omnidrive.files.str_path import is_path
from omnidrive.robot.robot import Robot
from omnidrive.robot.robot_file import is_robot_file, load_robot

_FILES = Path(__file__).parent / "data"


def paper() -> Robot:
    """Robot of the paper's simulator scene: 75.7 kg, four omni wheels in a square."""
    return _packaged("paper")


def small() -> Robot:
    """Robot of 10 kg with four omni wheels on a circle of 0.5 m diameter."""
    return _packaged("small")


def kiwi() -> Robot:
    """Robot of 6 kg with three omni wheels, the size of small indoor robots."""
    return _packaged("kiwi")


def mecanum() -> Robot:
    """Robot of 20 kg with four 6-inch mecanum wheels, the size of common research platforms."""
    return _packaged("mecanum")


def lekiwi() -> Robot:
    """LeKiwi with its arm: geometry of LeRobot's host program, masses and lags estimated."""
    return _packaged("lekiwi")


@cache
def _packaged(name: str) -> Robot:
    return load_robot(_FILES / f"{name}.yaml")


class _PackagedRobots(Mapping[str, Robot]):
    """Robots whose files are read on use, which keeps imports fast."""

    _factories: ClassVar = {each.__name__: each for each in (paper, small, kiwi, mecanum)}

    def __getitem__(self, name: str) -> Robot:
        return self._factories[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._factories)

    def __len__(self) -> int:
        return len(self._factories)


ROBOTS: Mapping[str, Robot] = _PackagedRobots()
"""Robots of studies, by name: those whose properties are all known, so not ``lekiwi``."""


def _check_not_a_file(name: str) -> None:
    """Raise InvalidInput if a text that names no robot has the form of a path."""
    if os.path.isfile(name):
        raise InvalidInput(f"{one_line(name)} is not a robot file: its name must end with .yaml")
    if is_path(name):
        raise InvalidInput(
            f"the robot file {one_line(name)} does not exist; its name must end with .yaml"
        )


def named_robot(name: str, *, assumed_effective_radius: float | None = None) -> Robot:
    """Return an installed robot or that of a file, optionally with a miscalibrated controller.

    Args:
        name: Name of a robot of this package or of an installed plugin (entry points of the group
            ``omnidrive.robots``), or the path of a robot file, which ends with .yaml or .yml.
        assumed_effective_radius: :attr:`Robot.assumed_effective_radius`; None: the robot's own.

    Raises:
        InvalidInput: There is no robot of that name.
        InvalidRobot: The file cannot be read or does not describe a robot.
    """
    if is_robot_file(name):
        robot = load_robot(name)
    elif name in ROBOTS:  # without a search for installed distributions
        robot = ROBOTS[name]
    else:
        known = dict.fromkeys([*ROBOTS, *component_names("robots")])
        if name not in known:
            _check_not_a_file(name)
            raise InvalidInput(
                f"there is no robot '{one_line(name, 60)}'{suggestion(name, known)} (your own: a "
                "robot file, which ends with .yaml)"
            )
        robot = find_component("robots", name).make()
    if not isinstance(robot, Robot):
        raise InvalidInput(
            f"the factory of the robot '{one_line(name)}' returned {kind_of(robot)}, not a Robot"
        )
    if assumed_effective_radius is None:
        return robot
    return replace(robot, assumed_effective_radius=assumed_effective_radius)
