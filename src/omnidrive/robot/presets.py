"""Robots of this package, by name."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from omnidrive.errors import InvalidInput, suggestion
from omnidrive.robot.mount import mecanum_rectangle, omni_ring
from omnidrive.robot.robot import Robot
from omnidrive.robot.wheel import OmniWheel

_CROSS = (0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi)

# The robot of the paper's simulator scene: 75.7 kg, wheel centres at (+-0.5, +-0.5) m, 50 N m.
# The scene sets no top speed; 120 rad/s (6 m/s at the rim) is this project's choice.
_PAPER = Robot(
    name="paper",
    mounts=omni_ring(_CROSS, 0.5 * 2**0.5),
    wheel=OmniWheel(radius=0.05, mass=2.0, rotor_inertia=5e-3),
    mass=75.7,
    com_height=0.0975,
    body_radius=0.75,
    max_wheel_speed=120.0,
    max_torque=50.0,
    servo_gain=20.0,
    friction=1.0,
    lag=(0.0065, 0.0013),
)
_SMALL = Robot(
    name="small",
    mounts=omni_ring(_CROSS, 0.25),
    wheel=OmniWheel(radius=0.05, mass=0.35, rotor_inertia=1e-3),
    mass=10.0,
    com_height=0.06,
    body_radius=0.28,
    max_wheel_speed=50.0,
    max_torque=2.0,
    servo_gain=1.0,
    friction=0.8,
    lag=(0.018, 0.006),
)
# Three wheels on a light plate; the size of small indoor robots.
_KIWI = Robot(
    name="kiwi",
    mounts=omni_ring((pi / 3.0, pi, -pi / 3.0), 0.17),
    wheel=OmniWheel(radius=0.04, mass=0.2, rotor_inertia=4e-4, roller_radius=0.01,
                    roller_mass=0.007, row_gap=0.018),
    mass=6.0,
    com_height=0.06,
    body_radius=0.21,
    max_wheel_speed=40.0,
    max_torque=1.5,
    servo_gain=1.2,
    friction=0.8,
    lag=(0.0088, 0.0038),
)  # fmt: skip
# Four 6-inch wheels under a plate of about 0.5 m by 0.4 m; the size of common research platforms.
_MECANUM = Robot(
    name="mecanum",
    mounts=mecanum_rectangle(0.2, 0.22),
    wheel=OmniWheel(radius=0.0762, mass=0.9, rotor_inertia=4e-3, rollers_per_row=12,
                    roller_radius=0.011, roller_mass=0.03, row_gap=0.05, rows=1),
    mass=20.0,
    com_height=0.1,
    body_radius=0.36,
    max_wheel_speed=25.0,
    max_torque=6.0,
    servo_gain=4.0,
    friction=0.8,
    lag=(0.0126, 0.0042),
)  # fmt: skip
ROBOTS = {robot.name: robot for robot in (_PAPER, _SMALL, _KIWI, _MECANUM)}
"""Robots of this package, by name."""


def named_robot(name: str, *, assumed_effective_radius: float | None = None) -> Robot:
    """Return a robot of :data:`ROBOTS`, optionally with a miscalibrated wheel controller.

    Args:
        name: Key of :data:`ROBOTS`.
        assumed_effective_radius: :attr:`Robot.assumed_effective_radius`; None: the robot's own.

    Raises:
        InvalidInput: There is no robot of that name.
    """
    if name not in ROBOTS:
        raise InvalidInput(f"there is no robot '{name}'{suggestion(name, ROBOTS)}")
    robot = ROBOTS[name]
    return (
        robot
        if assumed_effective_radius is None
        else replace(robot, assumed_effective_radius=assumed_effective_radius)
    )
