"""Drives that continue along a new path without a stop."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Pipeline
from omnidrive.control.controller import RetimingController
from omnidrive.deploy.clock import Clock, MonotonicClock
from omnidrive.deploy.controls import Continuation, DriveControls, Tracked
from omnidrive.deploy.realtime import schedule_below_loop
from omnidrive.deploy.ros2.drive_files import reference_file
from omnidrive.deploy.ros2.path_reference import path_reference
from omnidrive.errors import InvalidReference, OmnidriveError
from omnidrive.reference import SplicedReference
from omnidrive.robot import Robot

_TAKEN_WITHIN = 1.0  # s


@dataclass
class PathContinuation:
    """Motions along new paths that begin with the pose and twist of the tracked motion.

    They are computed in a thread of low priority, for a time that is ahead by as much as the
    computation is expected to take.

    Attributes:
        robot: The robot.
        pipeline: Pipeline of the drive.
        dt: Sample time, s.
        speed: Limit of the speed, m/s; None: that of the robot.
        leads: Bounds of the time from the beginning of a computation to that of its motion, s.
        clock: Clock of the drive.
        is_logged: Whether the drive has a log, which needs the motions as files.
    """

    robot: Robot
    pipeline: Pipeline
    dt: float
    speed: float | None = None
    leads: tuple[float, float] = (0.15, 1.0)
    clock: Clock = field(default_factory=MonotonicClock)
    is_logged: bool = True
    _taken: float = field(default=0.25, init=False)
    """Time of the last computation on the clock, s."""
    _count: int = field(default=1, init=False)
    _pool: ThreadPoolExecutor = field(init=False)
    _computed: Future[Continuation] | None = field(default=None, init=False)
    _requested: tuple[Continuation, float] | None = field(default=None, init=False)
    """What the loop is to take over, and the time until which it has to, s."""

    def __post_init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, "omnidrive paths", schedule_below_loop)

    def begin(self, poses: Float[Array, "poses 3"], controls: DriveControls) -> bool | None:
        """Begin to compute the motion along a path in W.

        Returns:
            Whether it is begun; false if the drive is held. None: the drive has not begun yet.
        """
        tracked = controls.tracked
        if tracked is None:
            return None if controls.starts else False
        self._computed = self._pool.submit(self._compute, poses, tracked)
        return True

    def poll(self, controls: DriveControls) -> bool | None:
        """Return whether the drive continues along the path; None: it is not decided yet."""
        if self._computed is not None:
            if not self._computed.done():
                return None
            computed, self._computed = self._computed, None
            try:
                found = computed.result()
            except OmnidriveError:
                return False
            controls.continuation = found
            self._requested = found, time.monotonic() + _TAKEN_WITHIN
        if self._requested is None:
            return False
        wanted, until = self._requested
        if controls.continuation is wanted and time.monotonic() < until:
            return None
        self._requested = None
        if controls.continuation is wanted:
            controls.continuation = None
        return controls.tracked is not None and controls.tracked.reference is wanted.spliced

    def abandon(self) -> None:
        """End what is computed; the drive has ended."""
        if self._computed is not None:
            self._computed.cancel()
        self._computed = self._requested = None

    def _compute(self, poses: Float[Array, "poses 3"], tracked: Tracked) -> Continuation:
        begun = self.clock.now()
        lead = 1.5 * self._taken + 2.0 * self.dt
        at = tracked.t + min(max(lead, self.leads[0]), self.leads[1])
        if at >= tracked.governed.duration:
            raise InvalidReference("the motion ends before another one can follow")
        pose, twist = tracked.governed.at(at)
        after = path_reference(poses, pose, self.robot, speed=self.speed, twist=twist)
        spliced = SplicedReference.of(tracked.governed, after, at)
        if isinstance(self.pipeline.controller, RetimingController):
            self.pipeline.controller.retime(spliced)  # the loop finds the result
        self._count += 1
        name = f"reference-{self._count:04}.csv"
        files = reference_file(after, self.dt, name) if self.is_logged else {}
        self._taken = self.clock.now() - begun
        return Continuation(tracked.reference, spliced, files)
