"""Extended Kalman filter for the pose: odometry, gyro and pose fixes with any delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import islice
from math import hypot, inf, isfinite, isnan, nan, pi

import numpy as np
from scipy.special import chdtri

from omnidrive.estimation.clock import ReadingClock, Stamp
from omnidrive.estimation.estimator_settings import EstimatorSettings
from omnidrive.estimation.plausibility import RateLimits, possible_angles, usable_fixes
from omnidrive.estimation.pose_filter.correction import INITIAL_COUNT, UNKNOWN_YAW, correct
from omnidrive.estimation.pose_filter.filter_state import (
    CORNERING,
    FIX_BIAS,
    FIX_BIAS_RATE,
    GYRO_BIAS,
    POSE,
    SIZE,
    FilterState,
)
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry
from omnidrive.estimation.pose_filter.propagation import propagate
from omnidrive.estimation.pose_filter.reading_buffer import (
    MAX_FIXES,
    BufferedFix,
    Interval,
    ReadingBuffer,
)
from omnidrive.estimation.pose_filter.relocation import JUMP_COVARIANCE, consistent, reachable
from omnidrive.estimation.readings import PoseFix, SensorReadings, unwrapped_pose
from omnidrive.estimation.sensor_settings import SensorSettings
from omnidrive.estimation.state import State, check_start
from omnidrive.geometry import Pose
from omnidrive.parameter import check_bounds
from omnidrive.robot import Robot
from omnidrive.robot.wheel import contact_wave

_LEAST_FOLLOWING_TIME = 3e-3
"""Least time constant with which a robot follows its servos, s; the integration of the slip is
stable with it."""

_CORNERING = (2.0e-3, 2.5e-3)
"""Mean and standard deviation of the slip speed per centripetal acceleration, s: measured on steady
curves are 0 on rigid contacts and 3.5e-3 and 6.7e-3 on MuJoCo's soft ones."""

_SHORTEST_INTERVAL = 1e-5
"""Shortest time between readings that are processed separately, s."""


class PoseEstimator:
    """An extended Kalman filter on SE(2) with left-invariant pose errors.

    The state vector is the pose, the gyro's bias, the bias of the pose fixes with its rate, the
    slip in curves, and the offsets of the wheels' contacts.

    All readings of the last ``memory`` seconds are stored: a late fix is inserted at its stamp, and
    all later readings are processed again, so that the result does not depend on the order of
    arrival.

    The bias of the fixes is not observable from fixes alone. It is zero at the known start and
    changes slowly; odometry drifts faster during wheel slip and more slowly over long times. The
    difference between fixes and odometry makes it observable.

    Readings that are impossible are ignored: times out of order, rates above twice what the motors
    can do, numbers that are not finite. When the pose is lost, because the clock jumped or the
    fixes contradict the estimate for long, the filter starts anew at the next fix, as with
    ``reset_on_time_jump`` of robot_localization, and :attr:`State.notice` says so.

    Args:
        robot: Wheels, mass and friction, from which slip during acceleration is predicted.
        sensors: Data sheets of the sensors whose readings are used.
        settings: Parameters of the filter.
        slips: Whether wheels can slip; false for a plant without masses.

    Attributes:
        filter_state: State vector and covariance at the last readings.
        rejected: Number of fixes since the reset that were rejected by the gate or as invalid, too
            old or from the future.
        ignored: Number of times, wheel angles and yaw rates since the reset that were ignored as
            impossible.
        nis: Normalised innovation squared of the last processed fix; 3 on average if the data
            sheets are correct, NaN before the first fix.
        relocations: Times (s) at which a relocation of the robot was detected.
        restarts: Times (s) at which the pose was lost.

    Raises:
        InvalidInput: A setting is out of its range.
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
        for each in (self.settings, sensors.encoders, sensors.gyro, sensors.fixes):
            check_bounds(each)
        self._limits = RateLimits.of(robot)
        self._model = _motion_model(robot, sensors, self.settings, self._limits, slips)
        self._radius = robot.wheel.radius
        self._slack = 2.0 * self._model.encoder_resolution
        self._unknown = np.full(len(robot.mounts), nan)
        self._gyro_bias = sensors.gyro.bias if sensors.gyro else 0.0
        self._gate = float(chdtri(3.0, self.settings.false_alarms))
        self._clock = ReadingClock(self.settings.time_jump)
        self._buffer = ReadingBuffer(self.settings.memory)
        self._contradicting: deque[PoseFix] = deque(maxlen=self.settings.restart_after)
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Discard all readings; at time 0 the robot is at rest at ``pose``, known exactly.

        Raises:
            InvalidInput: ``pose`` is not usable.
        """
        check_start(pose)
        self._clock.reset()
        self._buffer.intervals = []
        self._contradicting.clear()
        self._angles: list[float] = self._unknown.tolist()
        self._is_gap = False  # whether readings were dropped since the previous ones
        self.filter_state = self._initial(pose, known=True)
        self.rejected, self.ignored, self.nis = 0, 0, nan
        self.relocations: list[float] = []
        self.restarts: list[float] = []
        self._is_lost = False
        self._last_accepted = 0.0  # stamp of the last accepted fix, s

    def _initial(self, pose: Pose, *, known: bool) -> FilterState:
        """Return the filter state of a robot at rest at a pose, known exactly or roughly.

        At a known pose the bias of the fixes is zero, otherwise it has its stationary variance. The
        covariance of a known pose is that of the roundings of two encoder readings, of the start
        and of the current time.
        """
        model = self._model
        moves = model.contact_sigmas.any()
        offsets = np.repeat(model.contact_sigmas.ravel(), 2) if moves else np.zeros(0)
        size = SIZE + len(offsets)
        mean, covariance = np.zeros(size), np.zeros((size, size))
        covariance[SIZE:, SIZE:] = np.diag(offsets**2)
        mean[POSE] = pose
        mean[CORNERING], covariance[CORNERING, CORNERING] = (
            model.cornering[0],
            model.cornering[1] ** 2,
        )
        covariance[GYRO_BIAS, GYRO_BIAS] = self._gyro_bias**2
        rounding = model.encoder_resolution**2 / 6.0
        covariance[POSE, POSE] = rounding * np.linalg.inv(model.rim_jacobian.T @ model.rim_jacobian)
        rate_variances = (model.bias_sigma / model.bias_time) ** 2
        covariance[FIX_BIAS_RATE, FIX_BIAS_RATE] = np.diag(rate_variances)
        if not known:
            covariance[POSE, POSE] = JUMP_COVARIANCE
            covariance[FIX_BIAS, FIX_BIAS] = np.diag(model.bias_sigma**2)
        return FilterState(mean, covariance, np.zeros(3), 0.0, 0.0, 1.0, INITIAL_COUNT)

    @property
    def _pose(self) -> Pose:
        return Pose(*self.filter_state.mean[POSE].tolist())

    @property
    def fix_bias(self) -> Pose:
        """Estimated bias of the pose fixes; m, m, rad in W."""
        return Pose(*self.filter_state.mean[FIX_BIAS].tolist())

    def update(self, readings: SensorReadings) -> State:
        """Estimate the state at ``readings.stamp``.

        The first readings after a reset are those of the start. Readings with a time that is not
        finite, earlier than the last one or more than ``time_jump`` after it are ignored, and the
        last state is returned; a second such time in a row, in order with the first, is a jump of
        the clock.

        Raises:
            InvalidInput: The number of wheel angles is not that of the robot's wheels.
        """
        t, before, notice = float(readings.stamp), self._clock.time, ""
        stamp = self._clock.advance(t)
        if stamp is Stamp.DROPPED:
            self._is_gap = True
            self.ignored += 1
            self.rejected += len(readings.fixes)
            return self._state("")
        if stamp is Stamp.JUMPED and before is not None:
            self._last_accepted = t - (before - self._last_accepted)  # the age is kept
            self._angles = self._unknown.tolist()
            notice = self._lose(t, f"the clock jumped by {t - before:+g} s")
        if before is None:
            self._last_accepted = t
        self._append(readings, t)
        received, first = self._store(readings.fixes, t)
        self._reprocess(first)
        self.rejected += len(readings.fixes) - sum(item.accepted for item in received)
        self._detect_relocation(t)
        accepted = (item.fix.stamp for _, item in self._buffer.latest_fixes if item.accepted)
        self._last_accepted = max(self._last_accepted, next(accepted, self._last_accepted))
        if self._is_contradicted(received):
            count = self.settings.restart_after
            notice = self._lose(t, f"{count} pose fixes in a row contradict the estimate")
        self._buffer.prune()
        return self._state(notice)

    def _append(self, readings: SensorReadings, t: float) -> None:
        """Store wheel angles and yaw rate as those of the interval that ends at ``t``.

        The interval is empty if it would be too short; its wheel motion is then part of that of the
        next one.
        """
        intervals, before = self._buffer.intervals, self._angles
        angles = possible_angles(readings.wheel_angles, len(before))
        begin = intervals[-1].end if intervals else t
        if intervals and t - begin < _SHORTEST_INTERVAL:
            intervals.append(Interval(begin, begin, self._unknown, nan, self.filter_state))
            self._angles = [b if isnan(a) else a for a, b in zip(before, angles, strict=True)]
            return
        moved = [self._radius * (b - a) for a, b in zip(before, angles, strict=True)]
        farthest = self._radius * self._limits.wheel_speed * (t - begin) + self._slack
        possible = np.array([d if -farthest <= d <= farthest else nan for d in moved])
        rate = nan if readings.yaw_rate is None else float(readings.yaw_rate)
        is_possible = abs(rate) <= self._limits.twist[2]
        self.ignored += sum(map(_exceeds, readings.wheel_angles, angles))
        self.ignored += sum(map(_exceeds, moved, possible.tolist()))
        self.ignored += _exceeds(rate, rate if is_possible else nan)
        if self._is_gap or not is_possible:  # after dropped readings it is the mean since them only
            rate = nan
        intervals.append(Interval(begin, t, possible, rate, self.filter_state))
        self._angles, self._is_gap = angles, False

    def _store(self, fixes: Sequence[PoseFix], t: float) -> tuple[list[BufferedFix], int]:
        """Insert the usable fixes; return them, and the first interval that has to be filtered.

        If the pose is lost, the filter starts at the first of them. Of more than
        :data:`MAX_FIXES` the last ones are used. A position of unknown precision is not used, and a
        yaw of unknown precision counts as not measured.
        """
        stored, first = [], len(self._buffer.intervals) - 1
        end = self._buffer.intervals[-1].end
        precise = [fix for fix in usable_fixes(fixes, t) if not isnan(fix.position_sigma)]
        for fix in precise[-MAX_FIXES:]:
            yaw_sigma = inf if isnan(fix.yaw_sigma) else fix.yaw_sigma
            item = BufferedFix(fix._replace(stamp=min(fix.stamp, end), yaw_sigma=yaw_sigma))
            index = self._buffer.insert(item)
            if index is not None:
                stored.append(item)
                first = min(first, index)
        if self._is_lost and stored:
            min(stored).starts, self._is_lost = True, False
        return stored, first

    def _reprocess(self, first: int) -> None:
        """Filter all intervals from index ``first`` on."""
        intervals = self._buffer.intervals[first:]
        state = intervals[0].initial
        for interval in intervals:
            interval.initial = state
            state = self._filter(interval, state)
        self.filter_state = state

    def _filter(self, interval: Interval, state: FilterState) -> FilterState:
        """Propagate ``state`` through an interval and correct it with each of its fixes."""
        time = interval.begin
        for item in interval.fixes:
            state = self._propagate(state, interval, item.fix.stamp - time)
            time = item.fix.stamp
            if item.starts:
                yaw = float(state.mean[POSE][2])
                state = self._initial(unwrapped_pose(item.fix, yaw), known=False)
            if item.relocated:
                covariance = state.covariance.copy()
                covariance[POSE, POSE] += JUMP_COVARIANCE
                state = state._replace(covariance=covariance)
            item.prior = Pose(*state.mean[POSE].tolist())
            state, self.nis = self._correct(state, item)
            item.accepted = self.nis <= self._gate
        return self._propagate(state, interval, interval.end - time)

    def _propagate(self, state: FilterState, interval: Interval, dt: float) -> FilterState:
        """Propagate ``state`` by ``dt`` (s) with the interval's mean speeds."""
        if dt <= 0.0:
            return state
        fraction = dt / (interval.end - interval.begin)
        odometry = Odometry(
            fraction * interval.displacements, interval.yaw_rate, float(dt), float(fraction)
        )
        return propagate(state, odometry, self._model)

    def _correct(self, state: FilterState, item: BufferedFix) -> tuple[FilterState, float]:
        """Return the filter state at the stamp of a fix after its correction, and the fix's NIS."""
        _, measured, *sigmas = item.fix
        if not isfinite(sigmas[1]):  # the fix measures the position only
            measured = measured._replace(yaw=item.prior.yaw + float(state.mean[FIX_BIAS][2]))
            sigmas[1] = UNKNOWN_YAW
        floor = self.settings.floor
        sigma = max(float(sigmas[0]), floor), max(float(sigmas[1]), floor)
        return correct(state, np.array(measured, dtype=float), sigma, self._gate)

    def _detect_relocation(self, t: float) -> None:
        """Accept the latest fixes if enough of them in a row were rejected but are consistent."""
        latest = list(islice(self._buffer.latest_fixes, self.settings.relocate_after))[::-1]
        if (
            len(latest) == self.settings.relocate_after
            and not any(item.accepted for _, item in latest)
            and consistent([(item.fix, item.prior) for _, item in latest], self._pose)
        ):
            first, item = latest[0]
            item.relocated = True
            self._reprocess(first)
            if item.accepted:
                self.relocations.append(t)

    def _is_contradicted(self, received: list[BufferedFix]) -> bool:
        """Return whether enough fixes in a row were rejected that can be those of one robot."""
        for item in received:
            if item.accepted:
                self._contradicting.clear()
            else:
                self._contradicting.append(item.fix)
        enough = len(self._contradicting) == self._contradicting.maxlen
        return enough and reachable(self._contradicting, hypot(*self._limits.twist[:2].tolist()))

    def _lose(self, t: float, cause: str) -> str:
        """Start anew at the next fix; return the notice."""
        self.restarts.append(t)
        self._is_lost = True
        self._contradicting.clear()
        self.filter_state = self._initial(self._pose, known=False)
        self._buffer.intervals = [Interval(t, t, self._unknown, nan, self.filter_state)]
        return f"the estimate starts anew at the next pose fix: {cause}"

    def _state(self, notice: str) -> State:
        t = self._clock.time or 0.0
        covariance = self.filter_state.covariance[POSE, POSE].copy()
        return State(t, self._pose, None, covariance, t - self._last_accepted, notice)


def _exceeds(given: float, possible: float) -> bool:
    """Return whether a number was given, but is not possible."""
    return isnan(possible) and not isnan(given)


def _motion_model(
    robot: Robot,
    sensors: SensorSettings,
    settings: EstimatorSettings,
    limits: RateLimits,
    slips: bool,
) -> MotionModel:
    """Return the parameters of the motion model of a robot with these sensors.

    The stiffness is that of the velocity servos, but at most that with which the robot follows
    within :data:`_LEAST_FOLLOWING_TIME`. Without pose fixes the parameters of their bias have no
    effect.
    """
    gyro, fixes = sensors.gyro, sensors.fixes
    rim_jacobian, friction_limits = np.ascontiguousarray(robot.rim_jacobian), robot.friction_limits
    time, damping = fixes.bias_dynamics if fixes else (1.0, 0.9)
    waves = [contact_wave(robot.wheel, mount.roller_angle) for mount in robot.mounts]
    moves = 1.0 if slips else 0.0
    lengths = [
        [robot.wheel.radius * w.period / (2.0 * pi * n) for n in (1, w.order)] for w in waves
    ]
    shares = float((rim_jacobian[:, 0] ** 2).sum())
    stiffness = robot.servo_gain / robot.wheel.radius**2
    following_time = max(robot.mass / (shares * stiffness), _LEAST_FOLLOWING_TIME)
    return MotionModel(
        rim_jacobian=rim_jacobian,
        contact_sigmas=moves
        * np.array([[w.fundamental, hypot(w.harmonic, w.rest)] for w in waves]),
        contact_lengths=np.array(lengths),
        cornering=_CORNERING if slips else (0.0, 0.0),
        contact_rest=moves * np.array([w.rest for w in waves]),
        friction_limits=friction_limits if slips else np.full_like(friction_limits, np.inf),
        load_transfer=np.ascontiguousarray(robot.load_transfer),
        motor_limit=robot.max_torque / robot.wheel.radius,
        inertia=np.array(robot.inertia),
        stiffness=robot.mass / (shares * following_time),
        following_time=following_time,
        max_acceleration=1.0 / np.abs(robot.acceleration_faces).max(axis=0),
        max_twist=limits.twist,
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
