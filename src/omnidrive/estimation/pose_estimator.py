"""Extended Kalman filter for the pose: odometry, gyro and pose fixes with any delay."""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field
from math import isfinite, nan

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from omnidrive.arrays import Array
from omnidrive.estimation.correction import correct
from omnidrive.estimation.estimator_settings import EstimatorSettings
from omnidrive.estimation.filter_state import (
    FIX_BIAS,
    FIX_BIAS_RATE,
    GYRO_BIAS,
    POSE,
    SIZE,
    FilterState,
)
from omnidrive.estimation.motion_model import MotionModel, Odometry
from omnidrive.estimation.propagation import propagate
from omnidrive.estimation.readings import PoseFix, SensorReadings
from omnidrive.estimation.relocation import JUMP_COVARIANCE, consistent
from omnidrive.estimation.sensor_settings import SensorSettings
from omnidrive.estimation.state import State
from omnidrive.geometry import Pose
from omnidrive.robot import Robot

_FOLLOWING_TIME = 3e-3
"""Time constant with which a robot follows wheels that do not slip, s; results are insensitive."""

_UNKNOWN_YAW = 1e3
"""Standard deviation of a yaw that a fix does not measure, rad."""


@dataclass(order=True, slots=True)
class _BufferedFix:
    """A received fix; ordered by its stamp."""

    fix: PoseFix
    accepted: bool = field(default=False, compare=False)
    relocated: bool = field(default=False, compare=False)
    """Whether the robot was moved without its wheels shortly before the stamp."""
    prior: Pose = field(default=Pose(0.0, 0.0, 0.0), compare=False)
    """Estimated pose at the stamp, before the correction."""


@dataclass(slots=True)
class _Interval:
    """Readings between two consecutive updates."""

    begin: float
    end: float
    displacements: Float[Array, " wheels"]
    yaw_rate: float
    initial: FilterState
    """Filter state at ``begin``."""
    fixes: list[_BufferedFix] = field(default_factory=list)


class PoseEstimator:
    """An extended Kalman filter on SE(2) with left-invariant pose errors.

    The state vector is the pose, the gyro's bias, and the bias of the pose fixes with its rate.
    All readings of the last ``memory`` seconds are stored: a late fix is inserted at its stamp, and
    all later readings are processed again, so that the result does not depend on the order of
    arrival.

    The bias of the fixes is not observable from fixes alone. It is zero at the known start and
    changes slowly; odometry drifts faster during wheel slip and more slowly over long times. The
    difference between fixes and odometry makes it observable.

    Args:
        robot: Wheels, mass and friction, from which slip during acceleration is predicted.
        sensors: Data sheets of the sensors whose readings are used.
        settings: Parameters of the filter.
        slips: Whether wheels can slip; false for a plant without masses.

    Attributes:
        filter_state: State vector and covariance at the last readings.
        rejected: Number of fixes since the reset that were rejected by the gate or as invalid, too
            old or from the future.
        nis: Normalised innovation squared of the last processed fix; 3 on average if the data
            sheets are correct, NaN before the first fix.
        relocations: Times (s) at which a relocation of the robot was detected.
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
        self._model = _motion_model(robot, sensors, self.settings, slips)
        self._radius = robot.wheel.radius
        self._gyro_bias = sensors.gyro.bias if sensors.gyro else 0.0
        self._gate = float(chdtri(3.0, self.settings.false_alarms))
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Discard all readings; at time 0 the robot is at rest at ``pose``, known exactly."""
        model, mean, covariance = self._model, np.zeros(SIZE), np.zeros((SIZE, SIZE))
        mean[POSE] = pose
        covariance[GYRO_BIAS, GYRO_BIAS] = self._gyro_bias**2
        rate_variances = (model.bias_sigma / model.bias_time) ** 2
        covariance[FIX_BIAS_RATE, FIX_BIAS_RATE] = np.diag(rate_variances)
        self.filter_state = FilterState(mean, covariance, np.zeros(3), 0.0, 0.0)
        self.rejected, self.nis = 0, nan
        self.relocations: list[float] = []
        self._intervals: list[_Interval] = []
        self._angles = np.full(len(model.rim_jacobian), nan)
        self._last_accepted = 0.0  # stamp of the last accepted fix, s

    @property
    def _pose(self) -> Pose:
        return Pose(*self.filter_state.mean[POSE].tolist())

    @property
    def fix_bias(self) -> Pose:
        """Estimated bias of the pose fixes; m, m, rad in W."""
        return Pose(*self.filter_state.mean[FIX_BIAS].tolist())

    def update(self, readings: SensorReadings) -> State:
        """Estimate the state at ``readings.stamp``.

        The first readings after a reset are those of the start. Stamps must not decrease.
        """
        t = float(readings.stamp)
        angles = np.full(len(self._angles), nan)
        if readings.wheel_angles:
            angles[:] = readings.wheel_angles
        begin = self._intervals[-1].end if self._intervals else t
        if not self._intervals:
            self._last_accepted = t
        self._intervals.append(
            _Interval(
                begin,
                t,
                self._radius * (angles - self._angles),
                nan if readings.yaw_rate is None else float(readings.yaw_rate),
                self.filter_state,
            )
        )
        self._angles = angles
        received = [_BufferedFix(fix) for fix in readings.fixes]
        first = min((self._insert(item) for item in received), default=len(self._intervals) - 1)
        self._reprocess(first)
        self.rejected += sum(not item.accepted for item in received)
        self._detect_relocation(t)
        self._prune(t - self.settings.memory)
        return self._state(t)

    def _insert(self, item: _BufferedFix) -> int:
        """Insert a fix into the interval that contains its stamp; return the interval's index.

        A fix that is not finite, is from the future or is older than all intervals is dropped.
        """
        last = len(self._intervals) - 1
        stamp = item.fix.stamp
        numbers = (stamp, *item.fix.pose, item.fix.position_sigma)
        if not all(map(isfinite, numbers)) or stamp > self._intervals[last].end:
            return last
        for i in range(last, -1, -1):
            interval = self._intervals[i]
            if interval.begin < stamp or interval.begin == interval.end == stamp:
                insort(interval.fixes, item)
                return i
        return last

    def _reprocess(self, first: int) -> None:
        """Filter all intervals from index ``first`` on."""
        state = self._intervals[first].initial
        for interval in self._intervals[first:]:
            interval.initial = state
            state = self._filter(interval, state)
        self.filter_state = state

    def _filter(self, interval: _Interval, state: FilterState) -> FilterState:
        """Propagate ``state`` through an interval and correct it with each of its fixes."""
        time = interval.begin
        for item in interval.fixes:
            state = self._propagate(state, interval, item.fix.stamp - time)
            time = item.fix.stamp
            if item.relocated:
                covariance = state.covariance.copy()
                covariance[POSE, POSE] += JUMP_COVARIANCE
                state = state._replace(covariance=covariance)
            item.prior = Pose(*state.mean[POSE].tolist())
            state, self.nis = self._correct(state, item)
            item.accepted = self.nis <= self._gate
        return self._propagate(state, interval, interval.end - time)

    def _propagate(self, state: FilterState, interval: _Interval, dt: float) -> FilterState:
        """Propagate ``state`` by ``dt`` (s) with the interval's mean speeds."""
        if dt <= 0.0:
            return state
        fraction = dt / (interval.end - interval.begin)
        odometry = Odometry(
            fraction * interval.displacements, interval.yaw_rate, float(dt), float(fraction)
        )
        return propagate(state, odometry, self._model)

    def _correct(self, state: FilterState, item: _BufferedFix) -> tuple[FilterState, float]:
        _, measured, *sigmas = item.fix
        if not isfinite(sigmas[1]):  # the fix measures the position only
            measured = measured._replace(yaw=item.prior.yaw + float(state.mean[FIX_BIAS][2]))
            sigmas[1] = _UNKNOWN_YAW
        floor = self.settings.floor
        sigma = max(float(sigmas[0]), floor), max(float(sigmas[1]), floor)
        return correct(state, np.array(measured, dtype=float), sigma, self._gate)

    def _detect_relocation(self, t: float) -> None:
        """Accept the latest fixes if enough of them in a row were rejected but are consistent."""
        buffered = [(i, item) for i, each in enumerate(self._intervals) for item in each.fixes]
        latest = buffered[-self.settings.relocate_after :]
        if (
            len(latest) == self.settings.relocate_after
            and not any(item.accepted for _, item in latest)
            and consistent([(item.fix, item.prior) for _, item in latest], self._pose)
        ):
            first, item = latest[0]
            item.relocated = True
            self._reprocess(first)
            self.relocations.append(t)
        stamps = [item.fix.stamp for _, item in buffered if item.accepted]
        self._last_accepted = max([self._last_accepted, *stamps])

    def _prune(self, before: float) -> None:
        """Remove all intervals that ended before the time ``before`` (s), except the last one."""
        recent = [i for i, each in enumerate(self._intervals[:-1]) if each.end >= before]
        self._intervals = self._intervals[recent[0] if recent else -1 :]

    def _state(self, t: float) -> State:
        covariance = self.filter_state.covariance[POSE, POSE]
        return State(t, self._pose, None, covariance, t - self._last_accepted)


def _motion_model(
    robot: Robot, sensors: SensorSettings, settings: EstimatorSettings, slips: bool
) -> MotionModel:
    gyro, fixes = sensors.gyro, sensors.fixes
    rim_jacobian, friction_limits = np.ascontiguousarray(robot.rim_jacobian), robot.friction_limits
    time, damping = fixes.bias_dynamics if fixes else (1.0, 0.9)
    return MotionModel(
        rim_jacobian=rim_jacobian,
        friction_limits=friction_limits if slips else np.full_like(friction_limits, np.inf),
        load_transfer=np.ascontiguousarray(robot.load_transfer),
        motor_limit=robot.max_torque / robot.wheel.radius,
        inertia=np.array(robot.inertia),
        stiffness=robot.mass / (_FOLLOWING_TIME * float((rim_jacobian[:, 0] ** 2).sum())),
        max_acceleration=1.0 / np.abs(robot.acceleration_faces).max(axis=0),
        encoder_resolution=robot.wheel.radius * sensors.encoders.step,
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
