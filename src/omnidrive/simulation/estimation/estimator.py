"""An estimator of the pose from odometry, gyro and fixes, however late these come."""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field
from math import isfinite, nan, pi
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from omnidrive.geometry import Pose
from omnidrive.parameter import Bounds
from omnidrive.robot import Robot
from omnidrive.simulation.estimation.belief import BIAS, GYRO, POSE, RATE, SIZE, Belief
from omnidrive.simulation.estimation.correction import correct
from omnidrive.simulation.estimation.propagation import MotionModel, Odometry, propagate
from omnidrive.simulation.estimation.relocation import JUMP, agree
from omnidrive.simulation.sensing import Estimate, Fix, Readings, SensorSettings

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """What is not in the sensors' data sheets."""

    creep: Annotated[float, Bounds(0.0, 1.0, "m/sqrt(m)")] = 1e-3
    """Standard deviation of a rim's way after 1 m while no slip is suspected; it grows with the
    square root of the way."""
    slip_doubt: Annotated[float, Bounds(0.0, 100.0, "1")] = 2.0
    """Slip that is suspected, as a multiple of what redundant wheels and the gyro show of it: they
    do not show slip that looks like a motion."""
    slip_at_grip: Annotated[float, Bounds(0.0, 10.0, "m/s")] = 0.4
    """Usual slip of a rim whose wheel needs all its grip; less goes with the square of the part."""
    slip_memory: Annotated[float, Bounds(0.001, 60.0, "s")] = 0.05
    """Time constant with which a suspicion of slip fades."""
    false_alarms: Annotated[float, Bounds(1e-9, 0.5, "1")] = 1e-3
    """Share of sound fixes that is not believed."""
    relocate_after: Annotated[int, Bounds(2, 1000, "fixes")] = 5
    """Fixes in a row that are not believed but agree with each other: then the robot must have been
    carried away, and they are believed after all."""
    memory: Annotated[float, Bounds(0.0, 60.0, "s")] = 2.0
    """For how long readings are kept for fixes that come late; older ones are not used."""
    floor: Annotated[float, Bounds(1e-6, 1.0, "m, rad")] = 1e-3
    """Standard deviation that fixes have at least, whatever they say of themselves."""


@dataclass(order=True, slots=True)
class _Kept:
    """A fix that arrived."""

    fix: Fix
    believed: bool = field(default=False, compare=False)
    pose: tuple[float, ...] = field(default=(), compare=False)
    """Believed when it was taken, before it."""


@dataclass(slots=True)
class _Interval:
    """What was read of the time from one reading to the next."""

    begin: float
    end: float
    ways: Float[Array, " wheels"]
    yaw_rate: float
    before: Belief
    fixes: list[_Kept] = field(default_factory=list)
    carried: bool = False
    """Whether somebody carried the robot elsewhere before the first of the fixes."""


class PoseEstimator:
    """An extended Kalman filter on SE(2), invariant in its pose.

    Its state is the pose, the gyro's bias and the fixes' wandering bias. All readings of the last
    seconds are kept: a fix that comes late is put where it belongs, and what was read since is gone
    through again. So the order of arrival does not matter.

    The fixes' bias cannot be seen in fixes alone. It is known to be zero at the known start, and
    changes slowly; odometry drifts faster for a moment, when wheels slip, and slower for long. What
    is observable is the difference, and that at the start.

    Attributes:
        belief: Mean and covariance at the last readings.
        rejected: Fixes that were not believed when they arrived.
        too_old: Fixes that came later than what is kept.
        relocations: When (s) it found that the robot had been carried elsewhere.
    """

    def __init__(
        self,
        robot: Robot,
        sensors: SensorSettings | None = None,
        settings: EstimatorSettings | None = None,
    ) -> None:
        self.settings = settings or EstimatorSettings()
        sensors = sensors or SensorSettings()
        self._model = _model(robot, sensors, self.settings)
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
        self.belief = Belief(mean, covariance, np.zeros(3), 0.0, 0.0)
        self.rejected, self.too_old = 0, 0
        self.relocations: list[float] = []
        self._intervals: list[_Interval] = []
        self._angles = np.full(len(self._model.rims), nan)
        self._believed = 0.0  # s, when the last fix was taken that was believed

    @property
    def fix_bias(self) -> Pose:
        """What is believed of the fixes' bias: m, m, rad in W."""
        return Pose(*self.belief.mean[BIAS].tolist())

    def update(self, readings: Readings) -> Estimate:
        """What is believed after ``readings``, the first of which are of the start.

        Their times must not go back.
        """
        t = float(readings.t)
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
        return self._estimate(t)

    def _put(self, kept: _Kept) -> int:
        """Put a fix in the interval in which it was taken; return which."""
        last = len(self._intervals) - 1
        stamp = kept.fix.stamp
        if not all(map(isfinite, (stamp, *kept.fix.pose))) or stamp > self._intervals[last].end:
            return last
        for i in range(last, -1, -1):
            interval = self._intervals[i]
            if interval.begin < stamp or interval.begin == interval.end == stamp:
                insort(interval.fixes, kept)
                return i
        self.too_old += 1
        return last

    def _go_through(self, first: int) -> None:
        """Go through the intervals from ``first`` on, again or for the first time."""
        belief = self._intervals[first].before
        for interval in self._intervals[first:]:
            interval.before = belief
            belief = self._through(interval, belief)
        self.belief = belief

    def _through(self, interval: _Interval, belief: Belief) -> Belief:
        time, length = interval.begin, interval.end - interval.begin
        for number, kept in enumerate(interval.fixes):
            stamp = kept.fix.stamp
            belief = self._moved(belief, interval, stamp - time, length)
            time = stamp
            if interval.carried and number == 0:
                covariance = belief.covariance.copy()
                covariance[POSE, POSE] += JUMP
                belief = belief._replace(covariance=covariance)
            kept.pose = tuple(belief.mean[POSE].tolist())
            floor = self.settings.floor
            sigma = max(kept.fix.position_sigma, floor), max(kept.fix.yaw_sigma, floor)
            belief, distance = correct(belief, np.array(kept.fix.pose, float), sigma, self._gate)
            kept.believed = bool(distance <= self._gate)
        return self._moved(belief, interval, interval.end - time, length)

    def _moved(self, belief: Belief, interval: _Interval, dt: float, length: float) -> Belief:
        if dt <= 0.0:
            return belief
        part = dt / length
        odometry = Odometry(part * interval.ways, interval.yaw_rate, float(dt), float(part))
        return propagate(belief, odometry, self._model)

    def _look_around(self, t: float) -> None:
        """Believe fixes that were not, if so many in a row agree: the robot was carried away."""
        count = self.settings.relocate_after
        taken = [(i, kept) for i, each in enumerate(self._intervals) for kept in each.fixes]
        for _, kept in taken:
            if kept.believed:
                self._believed = max(self._believed, kept.fix.stamp)
        latest = [kept for _, kept in taken[-count:]]
        if len(latest) < count or any(kept.believed for kept in latest):
            return
        here = Pose(*self.belief.mean[POSE].tolist())
        if not agree([(kept.fix, Pose(*kept.pose)) for kept in latest], here):
            return
        first = taken[-count][0]
        interval = self._intervals[first]
        earlier = [kept for kept in interval.fixes if kept.fix < latest[0].fix]
        interval.fixes = [kept for kept in interval.fixes if kept not in earlier]
        interval.carried = True
        self._go_through(first)
        self.relocations.append(t)
        self._believed = max(self._believed, *(k.fix.stamp for k in latest if k.believed), 0.0)

    def _forget(self, before: float) -> None:
        """Forget intervals that ended before a time, but not the last."""
        kept = [i for i, each in enumerate(self._intervals[:-1]) if each.end >= before]
        self._intervals = self._intervals[kept[0] if kept else -1 :]

    def _estimate(self, t: float) -> Estimate:
        pose = Pose(*self.belief.mean[POSE].tolist())
        spread = self.belief.covariance[POSE, POSE]
        half, apart = 0.5 * (spread[0, 0] + spread[1, 1]), 0.5 * (spread[0, 0] - spread[1, 1])
        most = half + np.hypot(apart, spread[0, 1])  # the larger eigenvalue
        sigmas = np.sqrt(np.maximum([most, spread[2, 2]], 0.0)).tolist()
        return Estimate(pose, sigmas[0], sigmas[1], t - self._believed)


def _model(robot: Robot, sensors: SensorSettings, settings: EstimatorSettings) -> MotionModel:
    gyro, fixes = sensors.gyro, sensors.fixes
    traction = np.ascontiguousarray(robot.traction)
    wandering = fixes.wandering if fixes else (1.0, 0.9)
    return MotionModel(
        rims=np.ascontiguousarray(robot.rims),
        traction=traction,
        agility=1.0 / np.abs(traction).max(axis=0),
        quantum=robot.wheel.radius * 2.0 * pi / sensors.encoders.counts_per_turn,
        creep=float(settings.creep),
        slip_doubt=float(settings.slip_doubt),
        slip_at_grip=float(settings.slip_at_grip),
        slip_memory=float(settings.slip_memory),
        gyro_noise=gyro.noise_density if gyro else 0.0,
        gyro_walk=gyro.bias_walk if gyro else 0.0,
        bias_sigma=fixes.bias_sigma if fixes else np.zeros(3),
        bias_time=float(wandering[0]),
        bias_damping=float(wandering[1]),
    )
