"""Identification of wheel radius, effective radius, lags, delay and friction of a robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import hypot, sqrt
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Mount, Robot
from omnidrive.simulation.identification.estimate import (
    MIN_SEGMENTS,
    Estimate,
    checked,
    checked_time,
    missing,
)
from omnidrive.simulation.identification.fixes import Fixes
from omnidrive.simulation.identification.odometry import Odometry
from omnidrive.simulation.identification.regression import Fit, fit
from omnidrive.simulation.identification.response import response
from omnidrive.simulation.identification.robot_log import RobotLog

_SLIP_SHARE = 0.6  # used share of the friction limit from which a segment may contain slip
_OUTLIER = 2.5  # residual of a segment over the median from which its wheels slipped
_DELAYS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4)  # s, first iterates
_FRICTIONS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.1)  # first iterates
_SLIP_EXPLAINS = 0.5  # least share of the squared errors in segments with slip that it explains
_FRICTION_MODEL = 0.01  # error of Coulomb's law: rollers that reach the floor absorb momentum


@dataclass(frozen=True, slots=True)
class Identification:
    """Result of an identification.

    Attributes:
        estimates: Estimates of ``wheel radius`` (m), ``effective radius`` (m), ``lag in
            translation``, ``lag in rotation``, ``delay`` (s) and ``friction`` (1), by name.
        robot: The robot with the identified parameters; the others are unchanged. The delay is no
            parameter of a robot.
    """

    estimates: dict[str, Estimate]
    robot: Robot


def identify_robot(log: RobotLog, robot: Robot) -> Identification:
    """Identify parameters of a robot from a log.

    Wheel and effective radius follow from the wheel speeds integrated over segments of a second and
    the measured displacements; slipping segments are recognised by their residuals and left out.
    Lags and delay minimise the errors of poses and wheel speeds predicted from the commands in the
    segments without slip, friction those of the poses in the segments with slip (output-error
    method: Ljung, "System Identification", 2nd ed. 1999, section 4.3). Poses may be rarer than
    samples: displacements are predicted from pose to pose. Segments are then longer, five poses.

    Args:
        log: Samples of a drive from rest, ideally at 50 Hz or more: curves in all directions, small
            fast steps, and some hard starts in which the wheels slip.
        robot: The robot with its nominal parameters. Positions and directions of the wheels, masses
            and motors are used; its wheel radius and effective radius are those by which commands
            became wheel speeds.

    Raises:
        InvalidInput: The log has the wheel speeds of another number of wheels, or the nominal
            friction is zero.
    """
    count = len(robot.mounts)
    if not robot.friction > 0.0:
        raise InvalidInput(
            f"the friction of the robot '{robot.name}' is zero; give its nominal value, such as 0.8"
        )
    if log.wheel_speeds is not None and log.wheel_speeds.shape[1] != count:
        raise InvalidInput(
            f"the log has {log.wheel_speeds.shape[1]} wheels, the robot '{robot.name}' {count}"
        )
    data = _Data(log, robot)
    radius, effective = data.geometry()
    translation, rotation, delay = data.response()
    friction = data.friction(translation, rotation, delay)
    estimates = (radius, effective, translation, rotation, delay, friction)
    return Identification({each.name: each for each in estimates}, _identified(robot, *estimates))


@dataclass(slots=True)
class _Data:
    """Log and robot, and what the steps of the identification share."""

    log: RobotLog
    robot: Robot
    fixes: Fixes = field(init=False)
    odometry: Odometry | None = field(init=False, default=None)
    segments: Int[Array, " rows"] = field(init=False)
    commands: Float[Array, "rows 3"] = field(init=False)
    slipping: Bool[Array, " segments"] = field(init=False)
    """Segments whose odometry differs from the poses."""
    pose_sigma: float = field(init=False, default=1e-3)
    scales: tuple[float, float] = field(init=False, default=(1.0, 1.0))
    """Velocity of the body over that of the command, in translation and rotation."""
    coupling: float = field(init=False, default=1.0)
    """See :func:`response`."""

    def __post_init__(self) -> None:
        self.fixes = Fixes(self.log)
        self.segments = self.fixes.segments
        if self.log.wheel_speeds is not None:
            self.odometry = Odometry(self.log, self.log.wheel_speeds)
        self.slipping = np.zeros(len(self.fixes.counts), dtype=bool)
        drive = self.robot.drive
        self.commands = np.array(
            [drive.saturate(BodyTwist(*row)) for row in np.nan_to_num(self.log.commands).tolist()]
        )

    @property
    def followed(self) -> Bool[Array, " segments"]:
        """Segments with two poses or more."""
        found: Bool[Array, " segments"] = self.fixes.counts > 1
        return found

    def _checked(self, estimate: Estimate, reason: str) -> Estimate:
        """Return the estimate, or why the log does not determine it."""
        return checked(estimate, int(self.followed.sum()), self.fixes.length, reason)

    def geometry(self) -> tuple[Estimate, Estimate]:
        """Return wheel radius and effective radius, and mark slipping segments.

        ``r P^+ w`` is the body twist of the wheel speeds w, with the rim Jacobian P, whose column
        of the yaw rate scales with the effective radius.
        """
        if self.odometry is None:
            reason = "the log has no wheel speeds (columns wheel_speed_0, ...)"
            return (
                missing("wheel radius", "m", reason),
                missing("effective radius", "m", reason),
            )
        parts = self.odometry.turned @ np.linalg.pinv(self.robot.rim_jacobian).T
        turned = _cumulated(parts[:, 2:])
        yaw = self.fixes.yaw(self.robot.wheel.radius * turned[:, 0])
        moved = _cumulated(_turned(parts, 0.5 * (yaw[1:] + yaw[:-1])))
        known = self.followed & self.odometry.complete(self.segments)
        length, longest = self.fixes.length, self.odometry.longest
        seconds, lacking = length * int(known.sum()), known.sum() < self.followed.sum()
        if known.sum() < MIN_SEGMENTS <= self.followed.sum():
            reason = (
                f"the log has poses and wheel speeds without a gap of more than {longest:.2g} s in "
                f"{seconds:.3g} s, need {length * MIN_SEGMENTS:.3g} s"
            )
            return missing("wheel radius", "m", reason), missing("effective radius", "m", reason)
        used = known & ~self._may_slip()
        if used.sum() < MIN_SEGMENTS:
            used = known
        r, r_sigma, bad = _ratio(self.fixes, self.fixes.positions, moved, used)
        q, q_sigma, bad_yaw = _ratio(self.fixes, self.fixes.yaws, turned, used)
        self.slipping = known & (bad | bad_yaw)
        part = f" in the {seconds:.3g} s with wheel speeds" if lacking else ""
        radius = self._checked(
            Estimate("wheel radius", "m", r, r_sigma), f"the log holds too little motion{part}"
        )
        value = self.robot.effective_radius * r / q if r and q else np.nan
        relative = hypot(r_sigma / r, q_sigma / q) if r and q else np.inf
        # the contact alternates between rows at different distances: the mean of 1 / R
        gap = self.robot.wheel.row_gap if self.robot.wheel.rows == 2 else 0.0
        sigma = hypot(abs(value) * relative, (0.5 * gap) ** 2 / abs(value) / sqrt(3.0))
        effective = self._checked(
            Estimate("effective radius", "m", value, sigma),
            f"the log holds too little rotation{part}",
        )
        return radius, effective

    def response(self) -> tuple[Estimate, Estimate, Estimate]:
        """Return the lags of translation and rotation, and the delay."""
        names = ("lag in translation", "lag in rotation", "delay")
        gentle = self.followed & ~self._may_slip()
        rows = gentle[self.segments]
        if gentle.sum() < MIN_SEGMENTS:
            length = self.fixes.length
            reason = (
                f"{length * int(gentle.sum()):.3g} s of the log are certainly without wheel slip, "
                f"need {length * MIN_SEGMENTS:.3g} s of gentle motion"
            )
            first, second, third = (missing(name, "s", reason) for name in names)
            return first, second, third
        found = self._fit_response(rows)
        straight, turn, *_, self.coupling = found.values.tolist()
        self.scales = straight, turn
        slow = "the commands change too little for their noise and sample time"
        estimates = [
            checked_time(Estimate(name, "s", float(value), float(sigma)), slow)
            for name, value, sigma in zip(names, found.values[2:5], found.sigmas[2:5], strict=True)
        ]
        return estimates[0], estimates[1], estimates[2]

    def _fit_response(self, rows: Bool[Array, " rows"]) -> Fit:
        """Fit scales, lags and delay in two passes: the second with the noise of the first."""
        low = np.array([0.3, 0.3, 1e-4, 1e-4, 0.0, 0.0])
        high = np.array([3.0, 3.0, 2.0, 2.0, 1.0, 1.5])
        scales = np.array([1.0, 1.0, 0.01, 0.01, 0.01, 0.3])
        lag = [max(each, 1e-3) for each in self.robot.lag]
        sigmas = np.array([1e-3, 1e-3, 0.1])
        posed = self.segments[self.fixes.at][rows[self.fixes.at]]
        blocks = [posed] * 3
        if self.odometry is not None:
            measured = self.odometry.at[rows[self.odometry.at]]
            blocks += [self.segments[measured]] * self.odometry.speeds.shape[1]
        segments = np.concatenate(blocks)

        def residuals(values: Float[Array, " parameters"]) -> Float[Array, " residuals"]:
            """Return the errors of the response, each over its standard deviation."""
            blocks = self._response_errors(values, rows)
            return np.concatenate(
                [(block / sigma).T.ravel() for block, sigma in zip(blocks, sigmas, strict=False)]
            )

        starts = [np.array([1.0, 1.0, *lag, delay, 0.9]) for delay in _DELAYS]
        best = min(starts, key=lambda start: float((residuals(start) ** 2).sum()))
        found = fit(residuals, best, (low, high), scales, segments)
        blocks = self._response_errors(found.values, rows)
        sigmas = np.array([max(float(np.sqrt((b**2).mean())), 1e-6) for b in blocks])
        found = fit(residuals, found.values, (low, high), scales, segments)
        self.pose_sigma = float(sigmas[0])
        return found

    def _response_errors(
        self, values: Float[Array, " parameters"], rows: Bool[Array, " rows"]
    ) -> list[Array]:
        """Return the errors of positions, yaw and wheel speeds at the selected samples."""
        straight, turn, lag, yaw_lag, delay, coupling = values.tolist()
        twists, moves = response(
            self.robot, self.log.t, self.commands, (lag, yaw_lag), delay, coupling=coupling
        )
        blocks = self._pose_errors(moves * [straight, straight, turn], rows)
        if self.odometry is not None:
            predicted = self.odometry.predicted(twists, moves, self.robot.drive.jacobian)
            blocks.append((self.odometry.speeds - predicted)[rows[self.odometry.at]])
        return blocks

    def _pose_errors(
        self, moves: Float[Array, "rows 3"], rows: Bool[Array, " rows"]
    ) -> list[Array]:
        """Return the errors of positions and yaw within each of the selected segments."""
        turned = _cumulated(moves[:-1, 2:])
        steps = _turned(moves[:-1], self.fixes.yaw(turned[:, 0])[:-1])
        selected = rows[self.fixes.at]
        positions = self.fixes.positions - self.fixes.centred(_cumulated(steps))
        yaws = self.fixes.yaws - self.fixes.centred(turned)
        return [positions[selected], yaws[selected]]

    def _may_slip(self) -> Bool[Array, " segments"]:
        """Return the segments in which, or just before which, wheels may slip."""
        share = self._used_friction(self.robot.lag, 0.0)
        found = self.slipping.copy()
        np.logical_or.at(found, self.segments, share > _SLIP_SHARE)
        found[1:] |= found[:-1].copy()
        return found

    def _used_friction(self, lag: tuple[float, float], delay: float) -> Float[Array, " rows"]:
        """Return the largest share of the friction limits that a response without slip needs."""
        lag = (max(lag[0], 1e-3), max(lag[1], 1e-3))
        twists, _ = response(self.robot, self.log.t, self.commands, lag, delay)
        shifted = np.array(
            [np.interp(self.log.t - delay, self.log.t, each) for each in self.commands.T]
        ).T
        changes = (shifted - twists) / [lag[0], *lag]
        share: Float[Array, " rows"] = np.abs(changes @ self.robot.acceleration_faces.T).max(axis=1)
        return share

    def friction(self, translation: Estimate, rotation: Estimate, delay: Estimate) -> Estimate:
        """Return the friction coefficient."""
        if translation.reason:
            return missing("friction", "1", "it needs the lag in translation")
        lag = (translation.value, rotation.value if not rotation.reason else self.robot.lag[1])
        wait = 0.0 if delay.reason else delay.value
        share = self._used_friction(lag, wait)
        chosen = self.slipping.copy()
        np.logical_or.at(chosen, self.segments, share > 1.0)
        chosen &= self.followed
        rows = chosen[self.segments]
        motor = self.robot.max_torque / self.robot.wheel.radius
        least = float(np.quantile(share, 0.999)) * self.robot.friction
        slack = f"the wheels do not slip: friction is at least about {min(least, 9.9):.2g}"
        if chosen.sum() < 3:
            return missing("friction", "1", slack)
        segments = np.concatenate([self.segments[self.fixes.at][rows[self.fixes.at]]] * 2)

        def errors(mu: float | None, extra: float) -> Float[Array, " residuals"]:
            """Return the position errors with a friction coefficient and an extra delay (s)."""
            _, moves = response(
                self.robot, self.log.t, self.commands, lag, max(wait + extra, 0.0),
                friction=mu, coupling=self.coupling,
            )  # fmt: skip
            straight, turn = self.scales
            positions, _ = self._pose_errors(moves * [straight, straight, turn], rows)
            scaled: Float[Array, " residuals"] = positions.T.ravel() / self.pose_sigma
            return scaled

        def residuals(values: Float[Array, " 2"]) -> Float[Array, " residuals"]:
            """Return the errors with both as an array."""
            mu, extra = values.tolist()
            return errors(mu, extra)

        starts = [np.array([mu, 0.0]) for mu in _FRICTIONS]
        start = min(starts, key=lambda each: float((residuals(each) ** 2).sum()))
        bounds = (np.array([1e-3, -0.05]), np.array([5.0, 0.05]))
        found = fit(residuals, start, bounds, np.array([0.1, 0.01]), segments)
        value, extra = found.values.tolist()
        without = float((errors(None, extra) ** 2).sum())
        if float((found.residuals**2).sum()) > (1.0 - _SLIP_EXPLAINS) * without:
            return missing("friction", "1", slack)
        sigma = hypot(float(found.sigmas[0]), _FRICTION_MODEL * value)
        if value * self.robot.loads.min() > motor:
            slack = "the motors' torque limit is below the friction limit"
        return self._checked(Estimate("friction", "1", value, sigma), slack)


def _turned(vectors: Float[Array, "rows 3"], yaw: Float[Array, " rows"]) -> Float[Array, "rows 2"]:
    """Return the first two components of vectors in B, in W."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]]
    )


def _cumulated(parts: Float[Array, "intervals columns"]) -> Float[Array, "rows columns"]:
    return np.vstack([np.zeros(parts.shape[1]), np.cumsum(parts, axis=0)])


def _ratio(
    fixes: Fixes,
    outputs: Float[Array, "fixes columns"],
    path: Float[Array, "rows columns"],
    chosen: Bool[Array, " segments"],
) -> tuple[float, float, Bool[Array, " segments"]]:
    """Return the ratio of outputs to a path in chosen segments, its standard error, and outliers.

    Outliers are segments with far larger residuals than the median, in which wheels slip; they are
    left out.
    """
    segments, inputs = fixes.segments[fixes.at], fixes.centred(path)
    used, followed, outliers = chosen, fixes.counts > 1, np.zeros_like(chosen)
    products, squares = (
        np.bincount(segments, (each * inputs).sum(axis=1), len(used)) for each in (outputs, inputs)
    )
    value = 0.0
    for _ in range(10):
        total = float(squares[used].sum())
        if not total > 0.0:
            return 0.0, np.inf, outliers
        value = float(products[used].sum()) / total
        errors = outputs - value * inputs
        sums = np.bincount(segments, (errors**2).sum(axis=1), len(used))
        rms = np.sqrt(sums / np.maximum(fixes.counts, 1))
        largest = _OUTLIER * float(np.median(rms[chosen])) + 1e-12
        outliers = followed & (rms > largest)
        before, used = used, chosen & ~outliers
        if (before == used).all():
            break
    gradients = products - value * squares
    count = int(used.sum())
    if count < 2 or not float(squares[used].sum()) > 0.0:
        return value, np.inf, outliers
    variance = float((gradients[used] ** 2).sum()) * count / (count - 1)
    return value, sqrt(variance) / float(squares[used].sum()), outliers


def _identified(  # noqa: PLR0917
    robot: Robot,
    radius: Estimate,
    effective: Estimate,
    translation: Estimate,
    rotation: Estimate,
    _delay: Estimate,
    friction: Estimate,
) -> Robot:
    """Return the robot with the identified parameters.

    A changed effective radius moves all wheels away from or towards the centre in proportion.
    """
    changes: dict[str, Any] = {}
    if not radius.reason:
        changes["wheel"] = replace(robot.wheel, radius=radius.value)
    if not effective.reason:
        share = effective.value / robot.effective_radius
        changes["mounts"] = tuple(
            Mount(share * m.x, share * m.y, m.axle_angle, m.roller_angle) for m in robot.mounts
        )
    if not friction.reason:
        changes["friction"] = friction.value
    changes["lag"] = tuple(
        max(own if each.reason else each.value, 0.0)
        for own, each in zip(robot.lag, (translation, rotation), strict=True)
    )
    return replace(robot, **changes)
