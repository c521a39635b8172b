"""The supervisor that stops a robot and compensates for failed wheels."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot

import numpy as np

from omnidrive.control.controller import (
    STOP,
    Command,
    CommandValue,
    Controller,
    ReducibleController,
    WheelTorques,
)
from omnidrive.control.reduced_drive import ReducedDrive, limit_acceleration, reallocate
from omnidrive.control.supervision.supervisor import Event
from omnidrive.control.supervision.watchdog import Watchdog
from omnidrive.control.supervision.wheel_evidence import WheelDefect
from omnidrive.control.supervision.wheel_monitor import Finding, WheelMonitor
from omnidrive.errors import InvalidGeometry
from omnidrive.estimation import SensorReadings, State
from omnidrive.estimation.state import is_usable_number
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.robot import Robot

_SHARE = 0.85
"""Share of the wheels' friction that commands use once a wheel has failed."""
_LONGEST_STEP = 0.5
"""Longest motion per sample of a robot with a locked wheel, as a multiple of that wheel's lever
arm."""
_ITERATIONS = 20
"""Fixed-point iterations between rotation and translation; each leaves at most a quarter of the
error."""


@dataclass(slots=True)
class SafetySupervisor:
    """Stops the robot when a watchdog limit is exceeded, and compensates for failed wheels.

    Dead wheel: the twist is allocated to the other wheels and limited to their speeds and forces; a
    :class:`~omnidrive.control.ReducibleController` plans with them. Locked wheel: twists must lie
    in the null space of its row of the wheel matrix, which leaves two degrees of freedom. These
    control the position; the heading is not controlled, and the controller receives the reference
    heading as the estimated one.

    Attributes:
        robot: The robot without failures.
        watchdog: None: no watchdog.
        monitor: None: wheels are not monitored.
        controller: The controller with a reduced drive; None: that of ``reset`` is in use.
        events: Findings and reactions, in order.
        stopped: Reason for which the robot is being stopped; None: it is not being stopped.
    """

    robot: Robot
    watchdog: Watchdog | None = None
    monitor: WheelMonitor | None = None
    controller: Controller | None = field(default=None, init=False)
    events: list[Event] = field(default_factory=list, init=False)
    stopped: str | None = field(default=None, init=False)
    _original: Controller | None = field(default=None, init=False)
    """The controller of ``reset``."""
    _dead: set[int] = field(default_factory=set, init=False)
    _locked: int | None = field(default=None, init=False)
    _drive: ReducedDrive | None = field(default=None, init=False)
    _commanded: BodyTwist = field(default=STOP, init=False)
    """Twist of the last command; the present twist while torques are commanded."""
    _sent: CommandValue = field(default=STOP, init=False)
    """The last command."""
    _held: float | None = field(default=None, init=False)
    """Time for which the last command was held, s; None before the first."""
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)
    _reported_pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)
    """Pose that the controller receives."""
    _angles: tuple[float, ...] = field(default=(), init=False)
    """Wheel angles of the previous sample, rad."""
    _t: float = field(default=0.0, init=False)
    """Time of the sample, s."""

    def reset(self, controller: Controller) -> None:
        """Start a run with ``controller`` and all wheels healthy."""
        self.controller, self._original, self.stopped = None, controller, None
        self.events = []
        self._dead, self._locked, self._drive = set(), None, None
        self._commanded, self._sent, self._held = STOP, STOP, None
        self._angles, self._t = (), 0.0
        for part in (self.watchdog, self.monitor):
            if part is not None:
                part.reset()

    @property
    def at_rest(self) -> bool:
        """Whether the robot has been stopped and its command is zero."""
        return self.stopped is not None and self._commanded == STOP

    def check(self, t: float, readings: SensorReadings, state: State, target: Pose) -> State:
        """Check wheels and estimate at ``t`` (s) and return the state for the controller.

        Args:
            t: Time, s.
            readings: Wheel angles and motor torques of the sample that ends at ``t``.
            state: The estimate at ``t``.
            target: Reference pose at ``t``.
        """
        if self._held is not None and self.monitor is not None and self.stopped is None:
            found = self.monitor.update(
                self._sent, self._held, readings.wheel_angles, readings.wheel_torques
            )
            for finding in found:
                self._compensate(t, finding)
        if isinstance(self._sent, WheelTorques):
            self._commanded = self._present_twist(readings, state.pose)
        self._angles, self._t = readings.wheel_angles, t
        if self.watchdog is not None and self.stopped is None:
            reason = self.watchdog.check(t, state, target)
            if reason is not None:
                self._stop(t, reason)
        self._pose = self._reported_pose = state.pose
        if self._locked is None:
            return state
        self._reported_pose = Pose(state.pose.x, state.pose.y, target.yaw)
        return state._replace(pose=self._reported_pose)

    def limit(self, command: Command, dt: float) -> Command:
        """Return the command to send to the robot for ``dt`` (s) instead of ``command``.

        The robot is stopped by twists. With a dead wheel, wheel speeds become the twist of the
        other wheels, and wheel torques become torques of the other wheels with the same force and
        moment. With a locked wheel, wheel speeds become a twist too, and wheel torques stop the
        robot.
        """
        value = command.value
        if not isinstance(value, BodyTwist) and len(value) != len(self.robot.mounts):
            return command  # the plant refuses it
        if isinstance(value, WheelTorques) and self._locked is not None and self.stopped is None:
            self._stop(self._t, f"wheel {self._locked} is locked, which torques cannot compensate")
        if self.stopped is not None:
            value = self._braking(dt)
        elif self._locked is not None:
            value = self._in_null_space(self._twist_of(value), dt)
        elif self._drive is not None:
            value = self._with_driving_wheels(self._drive, value, dt)
        self._commanded, self._sent, self._held = self._twist_of(value), value, dt
        return command if value is command.value else command._replace(value=value)

    def _twist_of(self, value: CommandValue) -> BodyTwist:
        """Return the twist of a command; for torques, which have none, the present twist."""
        if isinstance(value, BodyTwist):
            return value
        if isinstance(value, WheelTorques):
            return self._commanded
        drive = self._drive
        if drive is None:
            return self.robot.drive.twist(value)
        return drive.chassis.twist([value[i] for i in drive.wheels])

    def _with_driving_wheels(
        self, drive: ReducedDrive, value: CommandValue, dt: float
    ) -> CommandValue:
        """Return the command for the driving wheels, within their limits."""
        if isinstance(value, WheelTorques):
            return WheelTorques(reallocate(self.robot, drive, value, _SHARE))
        twist = drive.chassis.saturate(self._twist_of(value))
        if self.controller is None:
            limits = drive.acceleration_faces / _SHARE
            twist = limit_acceleration(limits, self._commanded, twist, dt)
        return twist

    def _present_twist(self, readings: SensorReadings, pose: Pose) -> BodyTwist:
        """Return the mean twist since the previous sample by wheel angles, otherwise by poses."""
        before, now, dt = self._angles, readings.wheel_angles, self._held
        if dt is None:
            return STOP
        if len(before) == len(now) > 0 and all(map(is_usable_number, (*before, *now))):
            return self.robot.drive.twist(np.subtract(now, before) / dt)
        return twist_between(self._pose, pose, dt)

    def _stop(self, t: float, reason: str) -> None:
        self.stopped = f"at {t:.2f} s {reason}"
        self.events.append(Event(t, f"the watchdog stops the robot: {reason}"))

    def _compensate(self, t: float, found: Finding) -> None:
        name = f"wheel {found.wheel} {found.defect.value}"
        if found.defect is WheelDefect.DEAD_ENCODER:
            self.events.append(Event(t, name))
        elif found.defect is WheelDefect.LOCKED:
            self._release_heading(t, found.wheel, name)
        else:
            self._reduce_drive(t, found.wheel, name)

    def _reduce_drive(self, t: float, wheel: int, name: str) -> None:
        self._dead.add(wheel)
        try:
            drive = ReducedDrive.of(self.robot, self._dead)
        except InvalidGeometry:
            self._stop(t, f"{name}, and the others cannot compensate for it")
            return
        self._drive, reaction = drive, "commands are limited to them"
        current = self.controller or self._original
        if isinstance(current, ReducibleController) and self._locked is None:
            self.controller = current.with_reduced_drive(drive)
            reaction = "the controller plans with them"
        others = f"the other {len(drive.wheels)} compensate for it"
        self.events.append(Event(t, f"{name}; {others}, {reaction}"))

    def _release_heading(self, t: float, wheel: int, name: str) -> None:
        if self._locked is not None or abs(self._rim_row(wheel)[2]) < self._min_lever:
            self._stop(t, f"{name}, and the others cannot compensate for it")
            return
        self._locked = wheel
        self.events.append(Event(t, f"{name}; the position is controlled, the heading is not"))

    @property
    def _min_lever(self) -> float:
        """Lever arm, m, below which a wheel cannot rotate the robot."""
        return 1e-6 * self.robot.effective_radius

    def _rim_row(self, wheel: int) -> tuple[float, float, float]:
        """Rim speed of a wheel per body twist, 1, 1, m/rad, by the wheel matrix of the commands."""
        a, b, c = (self.robot.wheel.radius * self.robot.drive.jacobian[wheel]).tolist()
        return a, b, c

    def _braking(self, dt: float) -> BodyTwist:
        """Return the next twist on the straight line to rest, at the maximum deceleration."""
        limits = (self._drive or self.robot).acceleration_faces
        return limit_acceleration(limits / _SHARE, self._commanded, STOP, dt)

    def _in_null_space(self, twist: BodyTwist, dt: float) -> BodyTwist:
        """Return a twist that translates B as ``twist`` does while the locked wheel does not turn.

        The locked wheel's row (a, b, c) of the rim Jacobian constrains the twist by
        ``a vx + b vy + c yaw_rate = 0``. Because the robot rotates during the sample, the velocity
        along the arc to the goal depends on the yaw rate and vice versa; a fixed-point iteration
        solves for both.
        """
        assert self._locked is not None
        a, b, c = self._rim_row(self._locked)
        goal, here = move(self._reported_pose, twist, dt), self._pose
        dx, dy = goal.x - here.x, goal.y - here.y
        part = min(1.0, _LONGEST_STEP * abs(c) / max(hypot(dx, dy), 1e-12))
        vx, vy, turn = 0.0, 0.0, 0.0
        for _ in range(_ITERATIONS):
            there = Pose(here.x + part * dx, here.y + part * dy, here.yaw + turn * dt)
            vx, vy, _ = twist_between(here, there, dt)
            turn = -(a * vx + b * vy) / c
        desired = self.robot.drive.saturate(BodyTwist(vx, vy, turn))
        limits = self.robot.acceleration_faces / _SHARE
        vx, vy, _ = limit_acceleration(limits, self._commanded, desired, dt)
        return BodyTwist(vx, vy, -(a * vx + b * vy) / c)
