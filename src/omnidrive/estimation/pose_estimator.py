"""An estimator of the pose from odometry, gyro and fixes, however late these come."""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field
from math import isfinite, nan

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from omnidrive.arrays import Array
from omnidrive.estimation.correction import correct
from omnidrive.estimation.filter_state import BIAS, GYRO, POSE, RATE, SIZE, FilterState
from omnidrive.estimation.motion_model import MotionModel, Odometry
from omnidrive.estimation.propagation import propagate
from omnidrive.estimation.readings import PoseFix, SensorReadings
from omnidrive.estimation.relocation import JUMP, agree
from omnidrive.estimation.sensor_settings import SensorSettings
from omnidrive.estimation.settings import EstimatorSettings
from omnidrive.estimation.state import State
from omnidrive.geometry import Pose
from omnidrive.robot import Robot

_HOLDING_TIME = 3e-3
"""Time constant in s with which a robot follows wheels that hold; that of no robot matters more."""

_NO_YAW = 1e3
"""Standard deviation in rad of a yaw that was not measured."""


@dataclass(order=True, slots=True)
class _Kept:
    """A fix that arrived."""

    fix: PoseFix
    believed: bool = field(default=False, compare=False)
    carried: bool = field(default=False, compare=False)
    """Whether the robot was carried elsewhere shortly before it was taken."""
    pose: Pose = field(default=Pose(0.0, 0.0, 0.0), compare=False)
    """Believed when it was taken, before it."""


@dataclass(slots=True)
class _Interval:
    """What was read of the time from one reading to the next."""

    begin: float
    end: float
    ways: Float[Array, " wheels"]
    yaw_rate: float
    before: FilterState
    fixes: list[_Kept] = field(default_factory=list)


class PoseEstimator:
    """An extended Kalman filter on SE(2), invariant in its pose.

    Its state is the pose, the gyro's bias and the fixes' wandering bias. All readings of the last
    seconds are kept: a fix that comes late is put where it belongs, and what was read since is gone
    through again. So the order of arrival does not matter.

    The fixes' bias cannot be seen in fixes alone. It is known to be zero at the known start, and
    changes slowly; odometry drifts faster for a moment, when wheels slip, and slower for long. What
    is observable is the difference, and that at the start.

    Args:
        robot: Its wheels, mass and friction say how far wheels slip when it accelerates.
        sensors: Their data sheets; those of the sensors that are read.
        settings: The rest.
        slips: False for a robot without masses, whose wheels never slip.

    Attributes:
        belief: Mean and covariance at the last readings.
        rejected: Fixes that were not believed when they arrived, or came too late.
        surprise: Squared length of the latest fix's innovation, in standard deviations: 3 on
            average, if all is as the data sheets say.
        relocations: When (s) it found that the robot had been carried elsewhere.
    """

    def __init__(
        self,
        robot: Robot,
        sensors: SensorSettings | None = None,
        settings: EstimatorSettings | None = None,
        *,
        slips: bool = True,
    ) -> None:
        self.settings = settings or EstimatorSettings()
        sensors = sensors or SensorSettings()
        self._model = _model(robot, sensors, self.settings, slips)
        self._radius = robot.wheel.radius
        self._gyro_bias = sensors.gyro.bias if sensors.gyro else 0.0
        self._gate = float(chdtri(3.0, self.settings.false_alarms))
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Forget the past; the robot now stands at ``pose``, and that is known."""
        mean, covariance = np.zeros(SIZE), np.zeros((SIZE, SIZE))
        mean[POSE] = pose
        covariance[GYRO, GYRO] = self._gyro_bias**2
        covariance[RATE, RATE] = np.diag((self._model.bias_sigma / self._model.bias_time) ** 2)
        self.belief = FilterState(mean, covariance, np.zeros(3), 0.0, 0.0)
        self.rejected, self.surprise = 0, nan
        self.relocations: list[float] = []
        self._intervals: list[_Interval] = []
        self._angles = np.full(len(self._model.rim_jacobian), nan)
        self._believed = 0.0  # s, when the last fix was taken that was believed

    @property
    def _pose(self) -> Pose:
        return Pose(*self.belief.mean[POSE].tolist())

    @property
    def fix_bias(self) -> Pose:
        """What is believed of the fixes' bias: m, m, rad in W."""
        return Pose(*self.belief.mean[BIAS].tolist())

    def update(self, readings: SensorReadings) -> State:
        """What is believed after ``readings``, the first of which are of the start.

        Their times must not go back.
        """
        t = float(readings.stamp)
        angles = np.array(readings.wheel_angles, dtype=float)
        begin = self._intervals[-1].end if self._intervals else t
        if not self._intervals:
            self._believed = t
        self._intervals.append(
            _Interval(
                begin,
                t,
                self._radius * (angles - self._angles),
                nan if readings.yaw_rate is None else float(readings.yaw_rate),
                self.belief,
            )
        )
        self._angles = angles
        kept = [_Kept(fix) for fix in readings.fixes]
        first = min((self._put(each) for each in kept), default=len(self._intervals) - 1)
        self._go_through(first)
        self.rejected += sum(not each.believed for each in kept)
        self._look_around(t)
        self._forget(t - self.settings.memory)
        return self._state(t)

    def _put(self, kept: _Kept) -> int:
        """Put a fix in the interval in which it was taken; return which."""
        last = len(self._intervals) - 1
        stamp = kept.fix.stamp
        numbers = (stamp, *kept.fix.pose, kept.fix.position_sigma)
        if not all(map(isfinite, numbers)) or stamp > self._intervals[last].end:
            return last
        for i in range(last, -1, -1):
            interval = self._intervals[i]
            if interval.begin < stamp or interval.begin == interval.end == stamp:
                insort(interval.fixes, kept)
                return i
        return last

    def _go_through(self, first: int) -> None:
        """Go through the intervals from ``first`` on, again or for the first time."""
        belief = self._intervals[first].before
        for interval in self._intervals[first:]:
            interval.before = belief
            belief = self._through(interval, belief)
        self.belief = belief

    def _through(self, interval: _Interval, belief: FilterState) -> FilterState:
        time = interval.begin
        for kept in interval.fixes:
            belief = self._moved(belief, interval, kept.fix.stamp - time)
            time = kept.fix.stamp
            if kept.carried:
                covariance = belief.covariance.copy()
                covariance[POSE, POSE] += JUMP
                belief = belief._replace(covariance=covariance)
            kept.pose = Pose(*belief.mean[POSE].tolist())
            belief, self.surprise = self._corrected(belief, kept)
            kept.believed = self.surprise <= self._gate
        return self._moved(belief, interval, interval.end - time)

    def _moved(self, belief: FilterState, interval: _Interval, dt: float) -> FilterState:
        if dt <= 0.0:
            return belief
        part = dt / (interval.end - interval.begin)
        odometry = Odometry(part * interval.ways, interval.yaw_rate, float(dt), float(part))
        return propagate(belief, odometry, self._model)

    def _corrected(self, belief: FilterState, kept: _Kept) -> tuple[FilterState, float]:
        _, measured, *sigmas = kept.fix
        if not isfinite(sigmas[1]):  # only a position was measured
            measured = measured._replace(yaw=kept.pose.yaw + float(belief.mean[BIAS][2]))
            sigmas[1] = _NO_YAW
        floor = self.settings.floor
        sigma = max(float(sigmas[0]), floor), max(float(sigmas[1]), floor)
        return correct(belief, np.array(measured, dtype=float), sigma, self._gate)

    def _look_around(self, t: float) -> None:
        """Believe fixes that were not, if so many in a row agree: the robot was carried away."""
        taken = [(i, kept) for i, each in enumerate(self._intervals) for kept in each.fixes]
        latest = taken[-self.settings.relocate_after :]
        if (
            len(latest) == self.settings.relocate_after
            and not any(kept.believed for _, kept in latest)
            and agree([(kept.fix, kept.pose) for _, kept in latest], self._pose)
        ):
            first, kept = latest[0]
            kept.carried = True
            self._go_through(first)
            self.relocations.append(t)
        stamps = [kept.fix.stamp for _, kept in taken if kept.believed]
        self._believed = max([self._believed, *stamps])

    def _forget(self, before: float) -> None:
        """Forget intervals that ended before a time, but not the last."""
        kept = [i for i, each in enumerate(self._intervals[:-1]) if each.end >= before]
        self._intervals = self._intervals[kept[0] if kept else -1 :]

    def _state(self, t: float) -> State:
        covariance = self.belief.covariance[POSE, POSE]
        return State(t, self._pose, None, covariance, t - self._believed)


def _model(
    robot: Robot, sensors: SensorSettings, settings: EstimatorSettings, slips: bool
) -> MotionModel:
    gyro, fixes = sensors.gyro, sensors.fixes
    rim_jacobian, friction_limits = np.ascontiguousarray(robot.rim_jacobian), robot.friction_limits
    time, damping = fixes.bias_dynamics if fixes else (1.0, 0.9)
    return MotionModel(
        rim_jacobian=rim_jacobian,
        friction_limits=friction_limits if slips else np.full_like(friction_limits, np.inf),
        load_transfer=np.ascontiguousarray(robot.load_transfer),
        motor=robot.max_torque / robot.wheel.radius,
        inertia=np.array(robot.inertia),
        stiffness=robot.mass / (_HOLDING_TIME * float((rim_jacobian[:, 0] ** 2).sum())),
        agility=1.0 / np.abs(robot.acceleration_faces).max(axis=0),
        quantum=robot.wheel.radius * sensors.encoders.step,
        creep=float(settings.creep),
        slip_error=float(settings.slip_error),
        slip_doubt=float(settings.slip_doubt),
        slip_memory=float(settings.slip_memory),
        gyro_noise=gyro.noise_density if gyro else 0.0,
        gyro_walk=gyro.bias_walk if gyro else 0.0,
        bias_sigma=fixes.bias_sigma if fixes else np.zeros(3),
        bias_time=float(time),
        bias_damping=float(damping),
    )
