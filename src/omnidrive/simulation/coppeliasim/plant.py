"""The robot in CoppeliaSim."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from time import monotonic, sleep
from types import TracebackType
from typing import get_args

from omnidrive.errors import InvalidInput, InvalidScene, PlantLost
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, wrap
from omnidrive.robot import Robot
from omnidrive.simulation.coppeliasim.joints import Joints
from omnidrive.simulation.coppeliasim.link import Link
from omnidrive.simulation.coppeliasim.placing import moved, planar, seen_from, then, uprightness
from omnidrive.simulation.coppeliasim.scene import CoppeliaSimScene, Interface
from omnidrive.simulation.coppeliasim.signals import Signals
from omnidrive.simulation.plant import PlantCapabilities, PlantState

_REST = BodyTwist(0.0, 0.0, 0.0)
_UPRIGHT = 0.9  # cosine of the tilt up to which a yaw means something
_LEAST_STEP = 1e-5  # s that a simulator's step takes at least
_PAUSE = 0.01  # s between questions while a simulation stops


class CoppeliaSimPlant:
    """A robot in a scene that CoppeliaSim has open, which waits for us at every step.

    The command becomes wheel speeds by ``robot.drive`` (scaled together when one saturates), held
    for the sample time. Whatever ends a run, the wheels are stopped, and so is the simulation:
    by :meth:`close`, at the end of a ``with``, or by an error in :meth:`step`.
    """

    def __init__(self, robot: Robot, scene: CoppeliaSimScene | None = None) -> None:
        """Connect, and find the robot in the scene.

        Raises:
            InvalidInput: The settings do not fit the robot.
            InvalidScene: The scene does not hold what they name.
            MissingExtra: The vendor's client is not installed.
            PlantLost: CoppeliaSim does not answer.
        """
        self.robot = robot
        self.scene = scene or CoppeliaSimScene()
        _refuse_unless_fitting(robot, self.scene)
        self._drive = robot.drive
        self._link = Link(self.scene.host, self.scene.port, self.scene.timeout)
        try:
            self._find()
        except BaseException:
            self._link.close()
            raise
        self._started = False
        self._time, self._period = 0.0, nan
        self._yaw = 0.0

    def _find(self) -> None:
        """Ask for the handles of everything that is named; they hold until the scene changes."""
        scene, link = self.scene, self._link
        self._base = link.handle(scene.model)
        self._body = self._base if scene.body is None else link.handle(scene.body)
        self._motors: Joints | Signals = (
            Joints(link, scene.joints, scene.signs)
            if scene.interface == "joints"
            else Signals(link)
        )
        self._frame = Pose(0.0, 0.0, scene.body_yaw) if isinstance(self._motors, Joints) else None
        self._home = list(link.numbers(7, "getObjectPose", self._base))

    @property
    def capabilities(self) -> PlantCapabilities:
        """One instance at a time, because a running CoppeliaSim has one scene; with forces."""
        return PlantCapabilities(exclusive=True, forces=True)

    def reset(self, pose: Pose) -> PlantState:
        """Stop the simulation, place the robot, start it and let it wait.

        An object may be moved at any time, but only a simulation's start sets everything back: the
        joints' angles, the speeds, what the scene's scripts remember.

        Raises:
            InvalidInput: A simulation is running that this plant did not start.
            InvalidScene: The body's object does not stand upright, or a signal is not there.
            PlantLost: CoppeliaSim does not answer.
        """
        if not self._link.usable:
            self._link.open()
        try:
            return self._reset(pose)
        except BaseException:
            self.close()
            raise

    def _reset(self, pose: Pose) -> PlantState:
        self._stop()
        if self._link.call("getSimulationState") != 0:
            raise InvalidInput(
                "a simulation is running in CoppeliaSim that was not started from here: stop it "
                "first (its stop button, or sim.stopSimulation())"
            )
        body = self._link.numbers(7, "getObjectPose", self._body)
        if not uprightness(body) >= _UPRIGHT:
            raise InvalidScene(
                f"the z axis of '{self.scene.body or self.scene.model}' in CoppeliaSim does not "
                "point up: name another object of the robot, such as a dummy, as coppeliasim.body"
            )
        if self._frame is None:
            self._frame = self._frame_of_signals()
            body = self._link.numbers(7, "getObjectPose", self._body)
        base = self._link.numbers(7, "getObjectPose", self._base)
        here = then(planar(body), self._frame)
        self._link.call("setObjectPose", self._base, moved(base, here, pose))
        self._start()
        if isinstance(self._motors, Joints):
            self._motors.reset()
        self._motors.command([0.0] * len(self.robot.mounts))
        self._yaw = pose.yaw
        at, _ = self._motion()
        return self._measurement(at, _REST)

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Turn the wheels for ``dt`` seconds, a multiple of the simulator's time step.

        Raises:
            InvalidInput: It is none.
            PlantLost: CoppeliaSim does not answer any more, or was stopped or paused.
        """
        steps = self._steps(dt)
        try:
            self._motors.command(self._drive.wheel_speeds(self._drive.saturate(twist)).tolist())
            self._advance(steps)
            return self._measurement(*self._motion())
        except InvalidScene as error:
            self.close()
            raise PlantLost(str(error)) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Stop the wheels and the simulation, put the robot back, and leave.

        Does what can still be done, and raises nothing.
        """
        try:
            if self._started and not self._link.usable:
                self._link.open()
            if self._started:
                self._motors.command([0.0] * len(self.robot.mounts))
                self._stop()
                self._link.call("setObjectPose", self._base, self._home)
        except (PlantLost, InvalidScene):
            pass  # nobody is left to be told
        finally:
            self._started = False
            self._link.close()

    def __enter__(self) -> CoppeliaSimPlant:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _start(self) -> None:
        """Start a simulation that waits for us before every step."""
        link = self._link
        link.call("setStepping", False)  # a count per client: some versions keep it over a stop
        link.call("setStepping", True)
        self._started = True  # from now on there is something to stop
        link.call("startSimulation")
        (self._period,) = link.numbers(1, "getSimulationTimeStep")
        (self._time,) = link.numbers(1, "getSimulationTime")

    def _stop(self) -> None:
        """Stop the simulation that we started, and wait until it has stopped."""
        if not self._started:
            return
        self._link.call("stopSimulation")
        deadline = monotonic() + self.scene.timeout
        while self._link.call("getSimulationState") != 0:
            if monotonic() > deadline:
                raise PlantLost(
                    f"the simulation in CoppeliaSim did not stop within {self.scene.timeout:g} s"
                )
            sleep(_PAUSE)
        self._started = False

    def _steps(self, dt: float) -> int:
        """How many of the simulator's steps ``dt`` (s) is."""
        steps = round(dt / self._period) if self._period >= _LEAST_STEP else 0
        if steps < 1 or abs(steps * self._period - dt) > 1e-6 * dt:
            raise InvalidInput(
                f"the sample time {dt:g} s is not a multiple of CoppeliaSim's time step "
                f"{self._period:g} s: change the one in the scenario (sample_time), or the other "
                "in the scene's simulation settings"
            )
        return steps

    def _advance(self, steps: int) -> None:
        """Let so many steps pass."""
        for _ in range(steps):
            self._link.call("step")
            if isinstance(self._motors, Joints):
                self._motors.follow(self._period)
        (now,) = self._link.numbers(1, "getSimulationTime")
        expected = self._time + steps * self._period
        if not abs(now - expected) <= 0.5 * self._period:
            raise PlantLost(
                f"the simulation in CoppeliaSim was stopped or paused from outside at "
                f"{self._time:g} s: its clock shows {now:g} s, not {expected:g} s"
            )
        self._time = now

    def _motion(self) -> tuple[Pose, BodyTwist]:
        """Pose and velocity of B; the yaw is counted on from the last one."""
        assert self._frame is not None
        body = planar(self._link.numbers(7, "getObjectPose", self._body))
        linear, angular = self._velocity()
        at = then(body, self._frame)
        if isinstance(self._motors, Signals) and self._time > 0.0:  # before, no script has run
            at = self._motors.pose()
        self._yaw += wrap(at.yaw - self._yaw)
        dx, dy = at.x - body.x, at.y - body.y
        turning = angular[2]
        velocity = WorldTwist(linear[0] - turning * dy, linear[1] + turning * dx, turning)
        return Pose(at.x, at.y, self._yaw), to_body(velocity, self._yaw)

    def _velocity(self) -> tuple[Sequence[float], Sequence[float]]:
        """Linear (m/s) and angular (rad/s) velocity of the body's object, written in W."""
        value = self._link.call("getObjectVelocity", self._body)
        name = "sim.getObjectVelocity"
        if not isinstance(value, tuple) or len(value) != 2:
            raise PlantLost(f"CoppeliaSim answers {name} with no two vectors")
        return self._link.as_numbers(3, value[0], name), self._link.as_numbers(3, value[1], name)

    def _measurement(self, at: Pose, twist: BodyTwist) -> PlantState:
        motors = self._motors
        if isinstance(motors, Joints):
            return PlantState(at, twist, motors.work, motors.angles)
        return PlantState(at, twist, nan)

    def _frame_of_signals(self) -> Pose:
        """B in the frame of the body's object: what the pose told by signal is of.

        Raises:
            InvalidScene: The scene tells none, or holds another robot.
        """
        assert isinstance(self._motors, Signals)
        self._start()
        self._advance(1)
        self._motors.check(self.robot)
        told = self._motors.pose()
        body = planar(self._link.numbers(7, "getObjectPose", self._body))
        self._stop()
        return seen_from(body, told)


def _refuse_unless_fitting(robot: Robot, scene: CoppeliaSimScene) -> None:
    wheels = len(robot.mounts)
    if scene.interface not in get_args(Interface):
        raise InvalidInput(
            f"there is no interface '{scene.interface}' to CoppeliaSim; there are "
            f"{', '.join(get_args(Interface))}"
        )
    if scene.interface == "signals":
        if wheels != 4:
            raise InvalidInput(
                f"interface 'signals' is for the paper's four wheels; robot '{robot.name}' has "
                f"{wheels}: use interface 'joints'"
            )
        return
    for name, count in (("joints", len(scene.joints)), ("signs", len(scene.signs))):
        if count != wheels:
            raise InvalidInput(
                f"coppeliasim.{name} names {count} of {wheels} wheels of robot '{robot.name}': "
                "name one per wheel, in the order of its mounts"
            )
    if not set(scene.signs) <= {1, -1}:
        raise InvalidInput(f"coppeliasim.signs are 1 or -1, got {scene.signs}")
