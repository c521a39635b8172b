"""Check of a controller against the laws, the properties that all controllers must have."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isfinite, tau
from typing import Any

import numpy as np

from omnidrive.control import Controller, Status, WheelTorques
from omnidrive.control.command_check import checked_command
from omnidrive.control.components import ControllerContext
from omnidrive.errors import kind_of
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.robot import Robot
from omnidrive.simulation import KinematicPlant, PlanarPlant, Plant, simulate
from omnidrive.testing.laws import Circle, Law, Laws, rotated

_START = Pose(0.1, -0.8, 0.2)  # beside the circle
_GOAL = Pose(0.6, 0.6, 0.5)


def check_controller(
    factory: Callable[..., Any],
    *,
    robot: Robot | None = None,
    dt: float = 0.1,
    parameters: Any = None,
    wraps: bool = True,
    invariant: bool = True,
    converges: bool = True,
) -> None:
    """Check a controller against the laws of :class:`~omnidrive.control.Controller`.

    - It has ``reset`` and ``step``, and its commands are of the type ``Command``.
    - Two runs with the same inputs have the same commands, bit for bit; ``reset`` clears all
      memory.
    - Commands are finite, or their status is ``FAILED``, for any pose.
    - The state may have unknown parts (None).
    - A full turn of the reference, another value of the same heading, does not change the command
      (``wraps``).
    - Rotating the world does not change the command (``invariant``).
    - It reaches a pose, on a plant that executes commands exactly; with wheel torques, on the plant
      ``planar`` (``converges``).

    Args:
        factory: The class or function that makes the controller, as for the command-line option
            ``--controller``.
        robot: The robot. None: the built-in robot `small`.
        dt: Sample time, s.
        parameters: Parameters for the factory. None: the defaults.
        wraps: Whether the law of full turns applies; not for controllers that repeat the paper's
            published code, which does not wrap the error of the heading.
        invariant: Whether the law of rotation applies; not for controllers that depend on position
            or direction in the world, for example on a map.
        converges: Whether the law of convergence applies.

    Raises:
        InvalidInput: The class has not all methods, or they take other arguments.
        AssertionError: A law is broken; the message has one line for each.
    """
    laws = _ControllerLaws(factory, robot, parameters, dt)
    others: dict[str, Law] = {"finite_commands": laws.finite}
    if wraps:
        others["wrapped_heading"] = laws.full_turn
    if invariant:
        others["rotation_of_the_world"] = laws.rotation
    if converges:
        others["convergence"] = laws.convergence
    laws.check(**others)


class _ControllerLaws(Laws):
    """The laws for one factory."""

    kind, row = "controller", "command"

    def __init__(
        self, factory: Callable[..., Any], robot: Robot | None, parameters: Any, dt: float
    ) -> None:
        super().__init__(factory, robot, parameters)
        self.dt = dt

    def context(self) -> ControllerContext:
        """Return the context for the factory, with new random numbers."""
        rng = np.random.default_rng(0)
        return ControllerContext(self.robot, self.dt, rng, forces=False)

    def protocol(self) -> str | None:
        """Return why the object is no controller or its first command malformed; None: neither."""
        made = self.make()
        if not isinstance(made, Controller):
            return f"it is {kind_of(made)}, need reset(state) and step(t, state, reference)"
        command, units = self.first_command(made), getattr(made, "detail_units", None)
        return checked_command(command, None if units is None else len(units)).message or None

    def record(self, part: Controller) -> list[tuple[object, ...]]:
        """Return the commands and details of a run on the circle, one row per sample."""
        run = simulate(self.plant(), part, Circle(), start=_START, dt=self.dt).raise_if_failed()
        columns = [run.command, run.wheel_speed_command, run.wheel_torque_command]
        columns += [each[:, None] for each in run.details.values()]
        return list(map(tuple, np.hstack(columns).tolist()))

    def first_command(self, controller: Controller) -> Any:
        """Return the first command of a run on the circle, whose type is not checked yet."""
        state = State(0.0, _START)
        controller.reset(state)
        return controller.step(0.0, state, Circle())

    def plant(self) -> Plant:
        """Return a plant that executes the commands."""
        torques = isinstance(self.first_command(self.make()).value, WheelTorques)
        return PlanarPlant(self.robot) if torques else KinematicPlant(self.robot)

    def finite(self) -> str | None:
        """Return at which pose the command is not finite, however far the pose; None: nowhere."""
        for pose in (Pose(0.0, 0.0, 0.0), Pose(50.0, -50.0, 40.0), Pose(-1e3, 1e3, -3.0)):
            controller = self.make()
            controller.reset(State(0.0, _START))
            command = controller.step(0.0, State(0.0, pose), Circle())
            if command.status is not Status.FAILED and not all(map(isfinite, command.value)):
                return (
                    f"at the pose {tuple(pose)} its command is {command.value}, need finite values "
                    "or the status FAILED"
                )
        return None

    def full_turn(self) -> str | None:
        """Return how a reference whose headings are one turn greater changes the command."""
        commands = []
        for turn in (0.0, tau):
            controller, circle = self.make(), Circle(turn=turn)
            controller.reset(State(0.0, _START))
            commands.append(controller.step(0.0, State(0.0, _START), circle).value)
        if np.allclose(commands[0], commands[1], rtol=0.0, atol=1e-5):
            return None
        return (
            f"with the headings of the reference one turn greater, the command at 0 s is "
            f"{commands[1]} instead of {commands[0]}: wrap errors of the heading, as in "
            "omnidrive.wrap(target.yaw - pose.yaw)"
        )

    def rotation(self) -> str | None:
        """Return how a turn of the world changes the commands; None: not at all."""
        angle = 1.234
        one, two = self.make(), self.make()
        turned = rotated(_START, angle)
        one.reset(State(0.0, _START))
        two.reset(State(0.0, turned))
        for t in (0.0, self.dt):
            a = one.step(t, State(t, _START), Circle()).value
            b = two.step(t, State(t, turned), Circle(turn=angle)).value
            if not np.allclose(a, b, rtol=0.0, atol=1e-5):
                return (
                    f"with the world turned by {angle} rad, the command at {t:g} s is {b} instead "
                    f"of {a}: are errors in the world frame W used as velocities in the body "
                    "frame B? If the law depends on position or direction in W on purpose, as one "
                    "with a map does, pass invariant=False"
                )
        return None

    def convergence(self) -> str | None:
        """Return the error after 15 s at a constant goal if it is too large; None: it is not."""
        hold, start = Hold(_GOAL, 15.0), Pose(0.0, 0.0, 0.0)
        run = simulate(self.plant(), self.make(), hold, start=start, dt=self.dt).raise_if_failed()
        x, y, yaw = (run.pose[-1] - np.array(_GOAL)).tolist()
        if hypot(x, y) > 0.05 or abs(yaw) > 0.05:
            return (
                f"15 s after a step of 0.85 m and 0.5 rad it is {hypot(x, y):.2g} m and "
                f"{abs(yaw):.2g} rad away, need 0.05 m and 0.05 rad; if the law does not stop "
                "at a pose on purpose, as feedforward alone, pass converges=False"
            )
        return None
