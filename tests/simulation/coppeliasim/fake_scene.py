"""Fake scene: the MuJoCo plant under the names of a CoppeliaSim scene."""

from math import cos, pi, sin

import numpy as np

from omnidrive.geometry import Pose, to_world, wrap
from omnidrive.simulation import MujocoPlant
from omnidrive.simulation.coppeliasim.object_pose import planar_pose

BASE, FLOOR, FIRST_JOINT = 15, 16, 17
STOPPED, PAUSED, RUNNING, STOPPING = 0, 8, 17, 21


class Refused(Exception):
    """Error of a function, which the server returns to the client as text."""


class FakeScene:
    """Functions of the namespace `sim` that the plant uses, as the manual describes them."""

    def __init__(self, robot, *, step=0.05, signals=False, upright=True):
        self.robot, self.step_size = robot, step
        self.plant = MujocoPlant(robot, "ball")
        self.state, self.time, self.finished = STOPPED, 0.0, 0
        self.moves, self.signal = [], {}
        self.sends_signals = signals
        # motors 1 to 4 in the numbering of the paper's author
        wheels = len(robot.mounts)
        order = (2, 1, 0, 3) if wheels == 4 else range(wheels)
        self.joints = {FIRST_JOINT + k: wheel for k, wheel in enumerate(order)}
        self.paths = {"/omni": BASE, "/Floor": FLOOR}
        self.paths |= {f"/omni/motor{h - FIRST_JOINT + 1}": h for h in self.joints}
        self.height, self.upright = 0.05, upright
        self.begin = Pose(0.3, -0.2, 0.5)
        self.motion = self.plant.reset(self.begin)
        self.targets, self.angles = np.zeros(wheels), np.zeros(wheels)

    # behaviour of the simulator

    def advance(self):
        """Make one simulation step."""
        if self.state == STOPPING:
            self.state, self.time, self.finished = STOPPED, 0.0, self.finished + 1
            self.motion = self.plant.reset(self.begin)
            self.targets[:], self.angles[:] = 0.0, 0.0
            self.signal.clear()
            return
        if self.sends_signals:
            self._read_command()
        before = self.plant._data.actuator_velocity.copy()
        self.motion = self.plant.step(self.robot.chassis.twist(self.targets), self.step_size)
        after = self.plant._data.actuator_velocity
        self.angles += 0.5 * self.step_size * (before + after)
        self.time += self.step_size
        if self.sends_signals:
            self._write_signals()

    def _read_command(self):
        """Set the joint speeds as the script of the author's scene presumably does."""
        if "omni_reqVelocities0" in self.signal:
            packed = self.signal["omni_reqVelocities0"]
            for handle, speed in zip(self.joints, np.frombuffer(packed, "<f4"), strict=True):
                self.setJointTargetVelocity(handle, float(speed))

    def _write_signals(self):
        x, y, yaw = self.motion.pose
        self.signal["omni_pose0"] = np.array([x, y, wrap(yaw)], "<f4").tobytes()
        self.signal["omni_bodyDiameter0"] = 1.0
        self.signal["omni_wheelDiameter0"] = 0.1

    @property
    def torques(self):
        return self.plant._data.actuator_force

    # sim.*

    sceneobject_joint = 1
    simulation_stopped = STOPPED

    def getObject(self, path, options=None):  # noqa: N802
        if path in self.paths:
            return self.paths[path]
        if (options or {}).get("noError"):
            return -1
        raise Refused(f"Object does not exist. ('{path}')")

    def getObjectType(self, handle):  # noqa: N802
        self._check_handle(handle)
        return 1 if handle in self.joints else 0

    def getObjectPose(self, handle, relative=-1):  # noqa: N802
        self._check_handle(handle)
        x, y, yaw = self.motion.pose
        tilt = 0.0 if self.upright else 0.5**0.5
        upright = (1.0 - tilt**2) ** 0.5
        c, s = cos(0.5 * yaw), sin(0.5 * yaw)
        return [x, y, self.height, c * tilt, s * tilt, s * upright, c * upright]

    def setObjectPose(self, handle, pose):  # noqa: N802
        self._check_handle(handle)
        self.moves.append((handle, tuple(pose), self.state))
        self.height = pose[2]
        self.begin = planar_pose(pose)
        self.motion = self.plant.reset(self.begin)

    def getObjectVelocity(self, handle):  # noqa: N802
        self._check_handle(handle)
        vx, vy, rate = to_world(self.motion.twist, self.motion.pose.yaw)
        return [vx, vy, 0.0], [0.0, 0.0, rate]

    def setJointTargetVelocity(self, handle, speed):  # noqa: N802
        self.targets[self._joint(handle)] = -speed

    def getJointPosition(self, handle):  # noqa: N802
        return (-self.angles[self._joint(handle)] + pi) % (2.0 * pi) - pi

    def getJointVelocity(self, handle):  # noqa: N802
        return -float(self.plant._data.actuator_velocity[self._joint(handle)])

    def getJointForce(self, handle):  # noqa: N802
        return -float(self.torques[self._joint(handle)])

    def getSimulationTimeStep(self):  # noqa: N802
        return self.step_size

    def getSimulationTime(self):  # noqa: N802
        return self.time

    def getSimulationState(self):  # noqa: N802
        return self.state

    def startSimulation(self):  # noqa: N802
        if self.state in {STOPPED, PAUSED}:
            self.state = RUNNING
        return 1

    def stopSimulation(self):  # noqa: N802
        if self.state != STOPPED:
            self.state = STOPPING
        return 1

    def setBufferSignal(self, name, value):  # noqa: N802
        if not isinstance(value, bytes):
            raise Refused("buffer expected")
        self.signal[name] = value

    def getBufferSignal(self, name):  # noqa: N802
        return self.signal.get(name)

    def getFloatSignal(self, name):  # noqa: N802
        return self.signal.get(name)

    def _check_handle(self, handle):
        if handle not in self.paths.values():
            raise Refused("Object does not exist.")

    def _joint(self, handle):
        self._check_handle(handle)
        if handle not in self.joints:
            raise Refused("Object is not a joint.")
        return self.joints[handle]
