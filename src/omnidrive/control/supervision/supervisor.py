"""The supervisor: between a controller and its robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot

from omnidrive.control.controller import Command, Controller
from omnidrive.control.supervision.event import Event, Seen
from omnidrive.control.supervision.remaining import Remaining, eased
from omnidrive.control.supervision.watchdog import Watchdog
from omnidrive.control.supervision.wheel_monitor import Finding, WheelDefect, WheelMonitor
from omnidrive.errors import InvalidGeometry
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.robot import Robot

_STOP = BodyTwist(0.0, 0.0, 0.0)
_SHARE = 0.85
"""Part of what the wheels can push that commands are eased to once a wheel has failed."""
_LONGEST_STEP = 0.5
"""Of a robot with a locked wheel during one sample, as a multiple of that wheel's arm."""
_ROUNDS = 20
"""Of the fixed point between turning and travelling; each leaves a quarter of the error at most."""


Adapt = Callable[[Remaining], Controller]
"""Makes of the controller of the beginning one that goes on with the wheels that are left."""


@dataclass(slots=True)
class Supervisor:
    """Watches a run, stops the robot in time, and makes up for wheels that fail.

    A dead wheel: the twist is allocated to the others, commands keep to what these can turn and
    push, and a controller that plans with wheels is told. A locked wheel: twists
    must lie in the null space of its row of the wheel matrix, so two degrees of freedom are left.
    They go to the position; the heading is given up, and the controller is shown none of its error.

    Attributes:
        robot: As it was built.
        watchdog: None: nobody stops the robot.
        monitor: None: wheels are trusted.
        adapt: None: the controller knows nothing of wheels, and is kept.
        controller: The adapted one; None: that of the beginning.
        events: What happened, in order.
        stopped: Why the robot had to stop; None: it had not.
    """

    robot: Robot
    watchdog: Watchdog | None = None
    monitor: WheelMonitor | None = None
    adapt: Adapt | None = None
    controller: Controller | None = field(default=None, init=False)
    events: list[Event] = field(default_factory=list, init=False)
    stopped: str | None = field(default=None, init=False)
    _dead: set[int] = field(default_factory=set, init=False)
    _locked: int | None = field(default=None, init=False)
    _remaining: Remaining | None = field(default=None, init=False)
    _asked: BodyTwist = field(default=_STOP, init=False)
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)
    _shown: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)

    def reset(self) -> None:
        """Forget the past: a new run begins, with the controller of the beginning."""
        self.controller, self.stopped = None, None
        self.events = []
        self._dead, self._locked, self._remaining = set(), None, None
        self._asked = _STOP
        for part in (self.watchdog, self.monitor):
            if part is not None:
                part.reset()

    @property
    def at_rest(self) -> bool:
        """Whether the robot was stopped, and nothing is asked of it any more."""
        return self.stopped is not None and self._asked == _STOP

    def look(self, t: float, seen: Seen, target: Pose) -> Pose:
        """Judge the run at ``t`` (s); returns the pose that the controller shall see.

        Args:
            t: In s.
            seen: What is known of the robot.
            target: Where it shall be.
        """
        if self.watchdog is not None and self.stopped is None:
            why = self.watchdog.look(t, seen.pose, target, seen.position_sigma, seen.age)
            if why is not None:
                self._stop(t, why)
        self._pose = self._shown = seen.pose
        if self._locked is not None:
            self._shown = Pose(seen.pose.x, seen.pose.y, target.yaw)
        return self._shown

    def feel(self, t: float, command: BodyTwist, dt: float, seen: Seen) -> None:
        """Judge the wheels after a sample that ends at ``t`` (s).

        Args:
            t: In s.
            command: What was asked of the robot during it.
            dt: How long it was, in s.
            seen: What is known of the robot.
        """
        if self.monitor is None or self.stopped is not None:
            return
        for found in self.monitor.watch(command, dt, seen.wheel_angles, seen.wheel_torques):
            self._make_up_for(t, found)

    def allow(self, command: Command, dt: float) -> Command:
        """What to ask of the robot for ``dt`` seconds instead of what its controller commands."""
        twist = command.twist
        if self.stopped is not None:
            twist = self._braked(dt)
        elif self._locked is not None:
            twist = self._in_null_space(twist, dt)
        elif self._remaining is not None:
            twist = self._remaining.chassis.saturate(twist)
            if self.controller is None:
                twist = eased(self._remaining.acceleration_faces / _SHARE, self._asked, twist, dt)
        self._asked = twist
        return command if twist is command.twist else command._replace(twist=twist)

    def _stop(self, t: float, why: str) -> None:
        self.stopped = f"at {t:.2f} s {why}"
        self.events.append(Event(t, f"the watchdog stops the robot: {why}"))

    def _make_up_for(self, t: float, found: Finding) -> None:
        name = f"wheel {found.wheel} {found.defect.value}"
        if found.defect is WheelDefect.BLIND:
            self.events.append(Event(t, name))
        elif found.defect is WheelDefect.LOCKED:
            self._go_without_heading(t, found.wheel, name)
        else:
            self._drive_with_the_others(t, found.wheel, name)

    def _drive_with_the_others(self, t: float, wheel: int, name: str) -> None:
        self._dead.add(wheel)
        try:
            left = Remaining.of(self.robot, self._dead)
        except InvalidGeometry:
            self._stop(t, f"{name}, and the others cannot make up for it")
            return
        self._remaining, done = left, "limits are theirs"
        if self.adapt is not None and self._locked is None:
            self.controller = self.adapt(left)
            done = "the controller plans with them"
        self.events.append(Event(t, f"{name}; the other {len(left.wheels)} make up for it, {done}"))

    def _go_without_heading(self, t: float, wheel: int, name: str) -> None:
        if (
            self._locked is not None
            or abs(self._rim(wheel)[2]) < 1e-6 * self.robot.effective_radius
        ):
            self._stop(t, f"{name}, and the others cannot make up for it")
            return
        self._locked = wheel
        self.events.append(Event(t, f"{name}; the position is kept, the heading given up"))

    def _rim(self, wheel: int) -> tuple[float, float, float]:
        """Speed of its rim per unit of body twist, as commands are turned into wheel speeds."""
        a, b, c = (self.robot.wheel.radius * self.robot.drive.jacobian[wheel]).tolist()
        return a, b, c

    def _braked(self, dt: float) -> BodyTwist:
        """On the straight way to rest, as hard as the wheels can push."""
        left = self._remaining
        acceleration_faces = (
            self.robot.acceleration_faces if left is None else left.acceleration_faces
        )
        return eased(acceleration_faces / _SHARE, self._asked, _STOP, dt)

    def _in_null_space(self, twist: BodyTwist, dt: float) -> BodyTwist:
        """The twist that moves B as ``twist`` would, while the locked wheel does not turn.

        With the locked wheel's row (a, b, c), ``a vx + b vy + c yaw_rate = 0`` ties the yaw rate to
        the velocity. As the robot turns during the sample, the velocity that leads along an arc to
        the goal depends in turn on the yaw rate: a fixed point, found by iteration.
        """
        assert self._locked is not None
        a, b, c = self._rim(self._locked)
        goal, here = move(self._shown, twist, dt), self._pose
        dx, dy = goal.x - here.x, goal.y - here.y
        part = min(1.0, _LONGEST_STEP * abs(c) / max(hypot(dx, dy), 1e-12))
        vx, vy, turn = 0.0, 0.0, 0.0
        for _ in range(_ROUNDS):
            there = Pose(here.x + part * dx, here.y + part * dy, here.yaw + turn * dt)
            vx, vy, _ = twist_between(here, there, dt)
            turn = -(a * vx + b * vy) / c
        wanted = self.robot.drive.saturate(BodyTwist(vx, vy, turn))
        vx, vy, _ = eased(self.robot.acceleration_faces / _SHARE, self._asked, wanted, dt)
        return BodyTwist(vx, vy, -(a * vx + b * vy) / c)
