"""Check of a controller against the laws, the properties that all controllers must have."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isfinite
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.components import Component
from omnidrive.control import Command, Controller, Status, WheelSpeeds, WheelTorques
from omnidrive.control.components import ControllerContext
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import KinematicPlant, Outcome, PlanarPlant, Plant, Run, simulate
from omnidrive.testing.laws import Circle, Law, check_laws, first_difference, rotated

_START = Pose(0.1, -0.8, 0.2)  # beside the circle
_GOAL = Pose(0.6, 0.6, 0.5)


def check_controller(
    factory: Callable[..., Any],
    *,
    robot: Robot | None = None,
    dt: float = 0.1,
    parameters: Any = None,
    invariant: bool = True,
    converges: bool = True,
) -> None:
    """Check a controller against the laws of :class:`~omnidrive.control.Controller`.

    - It has ``reset`` and ``step``, and its commands are of the type ``Command``.
    - Two runs with the same inputs have the same commands, bit for bit; ``reset`` clears all
      memory.
    - Commands are finite, or their status is ``FAILED``, for any pose.
    - The state may have unknown parts (None).
    - Rotating the world does not change the command (``invariant``).
    - It reaches a pose, on a plant that executes commands exactly; with wheel torques, on the plant
      ``planar`` (``converges``).

    Args:
        factory: The class or function that makes the controller, as for the command-line option
            ``--controller``.
        robot: The robot. None: the built-in robot `small`.
        dt: Sample time, s.
        parameters: Parameters for the factory. None: the defaults.
        invariant: Whether the law of rotation applies; not for controllers that depend on the
            world, for example on a map.
        converges: Whether the law of convergence applies.

    Raises:
        AssertionError: A law is broken; the message has one line for each.
    """
    robot = robot or named_robot("small")
    laws = _Laws(Component("controllers", "the controller", "", factory), robot, dt, parameters)
    applicable: dict[str, Law] = {
        "protocol": laws.protocol,
        "command": laws.command,
        "determinism": laws.determinism,
        "finite commands": laws.finite,
    }
    if invariant:
        applicable["rotation of the world"] = laws.rotation
    if converges:
        applicable["convergence"] = laws.convergence
    check_laws("controller", applicable)


class _Laws:
    """The laws for one factory."""

    def __init__(self, component: Component, robot: Robot, dt: float, parameters: Any) -> None:
        self.component, self.robot, self.dt, self.parameters = component, robot, dt, parameters

    def make(self) -> Any:
        """Return a new object from the factory; its type is not checked yet."""
        rng = np.random.default_rng(0)
        context = ControllerContext(self.robot, self.dt, rng, forces=False)
        return self.component.make(context, self.parameters)

    def run(self, controller: Controller, start: Pose = _START) -> Run:
        return simulate(self.plant(), controller, Circle(), start=start, dt=self.dt)

    def plant(self) -> Plant:
        """Return a plant that executes the commands."""
        controller, state = self.make(), State(0.0, _START)
        controller.reset(state)
        first = controller.step(0.0, state, Circle())
        torques = isinstance(first.value, WheelTorques)
        return PlanarPlant(self.robot) if torques else KinematicPlant(self.robot)

    def protocol(self) -> str | None:
        made = self.make()
        if isinstance(made, Controller):
            return None
        return f"it is a {_named(made)}, need reset(state) and step(t, state, reference)"

    def command(self) -> str | None:
        controller, state = self.make(), State(0.0, _START)
        controller.reset(state)
        command: object = controller.step(0.0, state, Circle())
        if not isinstance(command, Command):
            return f"step returns a {_named(command)}, need Command(BodyTwist(vx, vy, yaw_rate))"
        if not isinstance(command.value, BodyTwist | WheelSpeeds | WheelTorques):
            return (
                f"its command holds a {_named(command.value)}, need a BodyTwist, WheelSpeeds or "
                "WheelTorques"
            )
        return None

    def determinism(self) -> str | None:
        controller = self.make()
        once, again, fresh = self.run(controller), self.run(controller), self.run(self.make())
        if once.outcome is not Outcome.FINISHED:
            return f"its run on a circle ends early: {once.ending}"
        row = first_difference(_commands(once), _commands(again))
        if row is not None:
            return f"after reset, the command at {once.t[row]:g} s differs: reset keeps some memory"
        row = first_difference(_commands(once), _commands(fresh))
        if row is not None:
            return f"a new controller differs at {once.t[row]:g} s: randomness or global state"
        return None

    def finite(self) -> str | None:
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

    def rotation(self) -> str | None:
        angle = 1.234
        one, two = self.make(), self.make()
        turned = rotated(_START, angle)
        one.reset(State(0.0, _START))
        two.reset(State(0.0, turned))
        for t in (0.0, self.dt):
            a = one.step(t, State(t, _START), Circle()).value
            b = two.step(t, State(t, turned), Circle(angle)).value
            if not np.allclose(a, b, rtol=0.0, atol=1e-5):
                return (
                    f"with the world turned by {angle} rad, the command at {t:g} s is {b} instead "
                    f"of {a}: are errors in the world frame W used as velocities in the body "
                    "frame B?"
                )
        return None

    def convergence(self) -> str | None:
        hold, start = Hold(_GOAL, 15.0), Pose(0.0, 0.0, 0.0)
        run = simulate(self.plant(), self.make(), hold, start=start, dt=self.dt)
        if run.outcome is not Outcome.FINISHED:
            return f"its run towards a pose ends early: {run.ending}"
        x, y, yaw = (run.pose[-1] - np.array(_GOAL)).tolist()
        if hypot(x, y) > 0.05 or abs(yaw) > 0.05:
            return (
                f"15 s after a step of 0.85 m and 0.5 rad it is {hypot(x, y):.2g} m and "
                f"{abs(yaw):.2g} rad away, need 0.05 m and 0.05 rad"
            )
        return None


def _commands(run: Run) -> Float[Array, "rows _"]:
    """Return all commands of a run, one row per sample."""
    return np.hstack([run.command, run.wheel_speed_command, run.wheel_torque_command])


def _named(value: object) -> str:
    return type(value).__name__
