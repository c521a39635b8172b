"""CoppeliaSim plant."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from time import monotonic, sleep

from omnidrive.control.controller import STOP, CommandValue
from omnidrive.errors import InvalidInput, InvalidScene, PlantLost
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, compose, to_body, wrap
from omnidrive.robot import Robot
from omnidrive.simulation.coppeliasim.joint_interface import JointInterface
from omnidrive.simulation.coppeliasim.object_pose import (
    planar_pose,
    relative_pose,
    transport,
    uprightness,
)
from omnidrive.simulation.coppeliasim.remote_api import RemoteApi
from omnidrive.simulation.coppeliasim.scene import CoppeliaSimScene
from omnidrive.simulation.coppeliasim.signal_interface import SignalInterface
from omnidrive.simulation.plant import (
    PlantCapabilities,
    PlantState,
    Saturation,
    check_robot,
    check_step,
)

_MIN_UPRIGHTNESS = 0.9  # cosine of the tilt up to which the yaw is well defined
_MIN_TIMESTEP = 1e-5  # s; shortest accepted time step of the simulator
_POLL_PERIOD = 0.01  # s; period of the state queries while a simulation stops


class CoppeliaSimPlant:
    """A robot in the open scene of CoppeliaSim, which is simulated in stepping mode.

    ``robot.drive`` converts a body twist into wheel speeds, scaled together if one exceeds its
    limit, which are held for the sample time. The wheels and the simulation are stopped at the end
    of every run: by :meth:`close`, at the end of a ``with``, or after an error in :meth:`step`.
    """

    def __init__(self, robot: Robot, scene: CoppeliaSimScene | None = None) -> None:
        """Connect, and look up the robot in the scene.

        Args:
            robot: The robot.
            scene: Connection and names; None: the defaults.

        Raises:
            InvalidInput: ``robot`` is not a robot, or the settings do not fit it.
            InvalidScene: The scene lacks an object of the settings.
            MissingExtra: The vendor's client is not installed.
            PlantLost: CoppeliaSim does not reply.
        """
        check_robot(robot, "CoppeliaSimPlant")
        self.robot = robot
        self.scene = scene or CoppeliaSimScene()
        _check_scene(robot, self.scene)
        self._api = RemoteApi(self.scene.host, self.scene.port, self.scene.timeout)
        try:
            self._look_up_objects()
        except BaseException:
            self._api.close()
            raise
        self._started = False
        self._time, self._period = 0.0, nan
        self._yaw = 0.0

    def _look_up_objects(self) -> None:
        """Get the handles of all named objects; they are valid until the scene changes."""
        scene, api = self.scene, self._api
        self._base = api.handle(scene.model)
        self._body = self._base if scene.body is None else api.handle(scene.body)
        self._motors: JointInterface | SignalInterface = (
            JointInterface(api, scene.joints, scene.signs)
            if scene.interface == "joints"
            else SignalInterface(api)
        )
        self._frame = (
            Pose(0.0, 0.0, scene.body_yaw) if isinstance(self._motors, JointInterface) else None
        )
        self._home = list(api.numbers(7, "getObjectPose", self._base))

    @property
    def capabilities(self) -> PlantCapabilities:
        """Exclusive, because a running CoppeliaSim has one scene; with forces and wheel speeds."""
        return PlantCapabilities(exclusive=True, forces=True, wheel_speeds=True)

    def reset(self, pose: Pose) -> PlantState:
        """Stop the simulation, move the robot to ``pose`` and start it in stepping mode.

        An object can be moved at any time, but only a start of the simulation also resets joint
        angles, speeds and the state of the scene's scripts.

        Raises:
            InvalidInput: A simulation is running that this plant did not start.
            InvalidScene: The body's object is not upright, or a signal is not set.
            PlantLost: CoppeliaSim does not reply.
        """
        if not self._api.usable:
            self._api.open()
        try:
            return self._reset(pose)
        except BaseException:
            self.close()
            raise

    def _reset(self, pose: Pose) -> PlantState:
        self._stop()
        if self._api.call("getSimulationState") != 0:
            raise InvalidInput(
                "a simulation is running in CoppeliaSim that this plant did not start: stop it "
                "first (its stop button, or sim.stopSimulation())"
            )
        body = self._api.numbers(7, "getObjectPose", self._body)
        if not uprightness(body) >= _MIN_UPRIGHTNESS:
            raise InvalidScene(
                f"the z axis of '{self.scene.body or self.scene.model}' in CoppeliaSim does not "
                "point up: name another object of the robot, such as a dummy, as plant.body"
            )
        if self._frame is None:
            self._frame = self._measure_signal_frame()
            body = self._api.numbers(7, "getObjectPose", self._body)
        base = self._api.numbers(7, "getObjectPose", self._base)
        current = compose(planar_pose(body), self._frame)
        self._api.call("setObjectPose", self._base, transport(base, current, pose))
        self._start()
        if isinstance(self._motors, JointInterface):
            self._motors.reset()
        self._motors.command([0.0] * len(self.robot.mounts))
        self._yaw = pose.yaw
        start, _ = self._motion()
        return self._plant_state(start, STOP)

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Execute ``command`` for ``dt`` seconds, a multiple of the simulator's time step.

        Raises:
            InvalidInput: The command is of wheel torques, or ``dt`` is not a multiple of the time
                step.
            PlantLost: CoppeliaSim does not reply, or was stopped or paused.
        """
        check_step(command, dt, self.capabilities, len(self.robot.mounts))
        speeds, scaled = self.robot.drive.limited_speeds(command)
        steps = self._steps(dt)
        try:
            self._motors.command(speeds.tolist())
            self._advance(steps)
            state = self._plant_state(*self._motion())
            return state._replace(saturated=Saturation.WHEEL_SPEED) if scaled else state
        except InvalidScene as error:
            self.close()
            raise PlantLost(str(error)) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Stop the wheels and the simulation, move the robot back, and disconnect.

        Errors of the connection are ignored.
        """
        try:
            if self._started and not self._api.usable:
                self._api.open()
            if self._started:
                self._motors.command([0.0] * len(self.robot.mounts))
                self._stop()
                self._api.call("setObjectPose", self._base, self._home)
        except (PlantLost, InvalidScene):
            pass  # there is no connection left
        finally:
            self._started = False
            self._api.close()

    def __enter__(self) -> CoppeliaSimPlant:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> None:
        """Start a simulation in stepping mode, which waits for a request before every step."""
        api = self._api
        api.call("setStepping", False)  # a counter; some versions keep it after a stop
        api.call("setStepping", True)
        self._started = True  # set first: also a failed start has to be stopped
        api.call("startSimulation")
        (self._period,) = api.numbers(1, "getSimulationTimeStep")
        (self._time,) = api.numbers(1, "getSimulationTime")

    def _stop(self) -> None:
        """Stop the simulation that this plant started, and wait until it has stopped."""
        if not self._started:
            return
        self._api.call("stopSimulation")
        deadline = monotonic() + self.scene.timeout
        while self._api.call("getSimulationState") != 0:
            if monotonic() > deadline:
                raise PlantLost(
                    f"the simulation in CoppeliaSim did not stop within {self.scene.timeout:g} s"
                )
            sleep(_POLL_PERIOD)
        self._started = False

    def _steps(self, dt: float) -> int:
        """Return the number of simulator steps in ``dt`` (s)."""
        steps = round(dt / self._period) if self._period >= _MIN_TIMESTEP else 0
        if steps < 1 or abs(steps * self._period - dt) > 1e-6 * dt:
            raise InvalidInput(
                f"the sample time {dt:g} s is not a multiple of CoppeliaSim's time step "
                f"{self._period:g} s: change sample_time in the scenario, or the time step in the "
                "scene's simulation settings"
            )
        return steps

    def _advance(self, steps: int) -> None:
        """Make simulator steps.

        Raises:
            PlantLost: The simulation was stopped or paused by another client or user.
        """
        for _ in range(steps):
            self._api.call("step")
            if isinstance(self._motors, JointInterface):
                self._motors.update(self._period)
        (now,) = self._api.numbers(1, "getSimulationTime")
        expected = self._time + steps * self._period
        if not abs(now - expected) <= 0.5 * self._period:
            raise PlantLost(
                f"the simulation in CoppeliaSim was stopped or paused from outside at "
                f"{self._time:g} s: its clock shows {now:g} s, not {expected:g} s"
            )
        self._time = now

    def _motion(self) -> tuple[Pose, BodyTwist]:
        """Return pose and velocity of B; the yaw is continued from the last one without a jump."""
        assert self._frame is not None
        body = planar_pose(self._api.numbers(7, "getObjectPose", self._body))
        linear, angular = self._velocity()
        pose = compose(body, self._frame)
        # at time 0 no script has run yet
        if isinstance(self._motors, SignalInterface) and self._time > 0.0:
            pose = self._motors.pose()
        self._yaw += wrap(pose.yaw - self._yaw)
        dx, dy = pose.x - body.x, pose.y - body.y
        yaw_rate = angular[2]
        velocity = WorldTwist(linear[0] - yaw_rate * dy, linear[1] + yaw_rate * dx, yaw_rate)
        return Pose(pose.x, pose.y, self._yaw), to_body(velocity, self._yaw)

    def _velocity(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return linear (m/s) and angular (rad/s) velocity of the body's object, in W."""
        value = self._api.call("getObjectVelocity", self._body)
        name = "sim.getObjectVelocity"
        if not isinstance(value, tuple) or len(value) != 2:
            raise PlantLost(f"CoppeliaSim does not return two vectors for {name}")
        return self._api.as_numbers(3, value[0], name), self._api.as_numbers(3, value[1], name)

    def _plant_state(self, pose: Pose, twist: BodyTwist) -> PlantState:
        motors = self._motors
        if isinstance(motors, JointInterface):
            return PlantState(pose, twist, motors.work, motors.angles, wheel_speeds=motors.speeds)
        return PlantState(pose, twist, nan)

    def _measure_signal_frame(self) -> Pose:
        """Return the pose of B, which the signal reports, in the frame of the body's object.

        Raises:
            InvalidScene: The signal is not set, or the scene holds another robot.
        """
        assert isinstance(self._motors, SignalInterface)
        self._start()
        self._advance(1)
        self._motors.check_dimensions(self.robot)
        reported = self._motors.pose()
        body = planar_pose(self._api.numbers(7, "getObjectPose", self._body))
        self._stop()
        return relative_pose(body, reported)


def _check_scene(robot: Robot, scene: CoppeliaSimScene) -> None:
    wheels = len(robot.mounts)
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
                f"plant.{name} names {count} of {wheels} wheels of robot '{robot.name}': "
                "name one per wheel, in the order of its mounts"
            )
    if not set(scene.signs) <= {1, -1}:
        raise InvalidInput(f"plant.signs are 1 or -1, got {scene.signs}")
