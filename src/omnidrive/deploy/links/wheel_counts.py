"""Wheel angles from the reports of a motor board that may restart, or report false counts."""

from __future__ import annotations

from collections import deque
from math import pi
from typing import NamedTuple

from omnidrive.deploy.links.wheel_protocol import (
    Hello,
    Report,
    count_difference,
    sequence_difference,
    stamp_difference,
)

SPEED_MARGIN = 1.5
"""A wheel that turns faster than this many times its largest speed is reported falsely."""
SLACK = 0.1
"""Angle by which a wheel may turn in addition, rad: counts and stamp are not taken at once."""
WITHHELD = 1.0
"""Time for which no angles are given after the last false report, s; longer than the age of
readings at which a drive is held."""
STUCK_TIME, STUCK_SHARE = 1.0, 0.1
"""A wheel is stuck if its count stays the same for this time, s, while it is commanded to turn in
one direction with at least this share of its largest speed."""
_STUCK_COUNTS = 10  # counts in that time, below which an encoder is too coarse to tell
_AHEAD = 0.5  # s by which stamps of two reports may differ more than their arrivals
_MAX_FALSE = 5  # false reports within WITHHELD; fewer are ignored
_MAX_OLDER = 10  # reports in a row that are older than the last one
_OFFSET_REPORTS = 200  # reports from which the offset of the board's clock is estimated


class _Arrived(NamedTuple):
    """A report, and its arrival on our clock, s."""

    report: Report
    at: float


class WheelCounts:
    """Angles of the wheels of a board.

    Single false reports are ignored. After several, after a restart and after another greeting, no
    report is used until the board greets as at first and its reports follow one another for
    :data:`WITHHELD`. The angles then go on by what the wheels turned since the last report that was
    used, or from there if that is more than they can turn.

    Args:
        hello: First greeting of the board.
        fastest: Largest speed of the wheels, rad/s.
    """

    def __init__(self, hello: Hello, fastest: float) -> None:
        self.lost = 0
        """Number of reports that did not arrive."""
        self.fault = ""
        """Why the last report is not used, in one line; empty: it is."""
        self._hello, self._fastest = hello, fastest
        self._unit = 2.0 * pi / hello.counts  # rad
        self._turned = [0] * hello.wheels
        self._last: _Arrived | None = None  # that is used
        self._previous: _Arrived | None = None  # while reports are withheld
        self._older = 0
        self._false: deque[float] = deque(maxlen=_MAX_FALSE)
        self._withheld_since: float | None = None  # s; None: reports are used
        self._greeted = True  # as at first, since reports are withheld
        self._board_time = 0.0  # s of the last report since the first, by the board's clock
        self._offsets: deque[float] = deque(maxlen=_OFFSET_REPORTS)
        self._commanded: tuple[float, ...] = ()
        self._still_since: list[float | None] = [None] * hello.wheels
        enough = STUCK_SHARE * fastest * STUCK_TIME >= _STUCK_COUNTS * self._unit
        self._min = STUCK_SHARE * fastest if enough else float("inf")

    @property
    def withheld(self) -> bool:
        """Whether no report is used."""
        return self._withheld_since is not None

    @property
    def needs_greeting(self) -> bool:
        """Whether the board must be asked what it is."""
        return self.withheld and not self._greeted

    @property
    def angles(self) -> tuple[float, ...]:
        """Angle of each wheel since the first report, rad."""
        return tuple(self._unit * count for count in self._turned)

    @property
    def stamp(self) -> float:
        """Time of the angles on our clock, s: the smallest difference has the least delay."""
        return self._board_time + min(self._offsets)

    def greet(self, hello: Hello, now: float) -> None:
        """Compare a later greeting of the board, which arrived at ``now`` (s), with the first."""
        self._greeted = hello == self._hello
        if not self._greeted:
            self._withhold(
                now,
                f"the motor board has another greeting than at first: version {hello.version}, "
                f"{hello.wheels} wheels, {hello.counts} counts per turn, watchdog "
                f"{hello.watchdog:g} s",
            )

    def command(self, speeds: tuple[float, ...], now: float) -> None:
        """Note the commanded wheel speeds (rad/s) from ``now`` (s) on."""
        before = self._commanded or (0.0,) * len(speeds)
        for i, (then, speed) in enumerate(zip(before, speeds, strict=True)):
            if abs(speed) < self._min:
                self._still_since[i] = None
            elif self._still_since[i] is None or then * speed < 0.0:
                self._still_since[i] = now
        self._commanded = speeds

    def take(self, report: Report, now: float) -> bool:
        """Take a report that arrived at ``now`` (s); return whether it gives new angles."""
        wheels = self._hello.wheels
        if len(report.counts) != wheels:
            self._reject(now, f"the motor board reports {len(report.counts)} wheels, not {wheels}")
            return False
        if self.withheld:
            return self._take_withheld(_Arrived(report, now))
        if self._last is None:
            self._use(_Arrived(report, now))
            return True
        if not _is_newer(report, self._last.report):  # repeated or overtaken
            self._older += 1
            if self._older >= _MAX_OLDER:
                self._withhold(
                    now,
                    "the reports of the motor board begin anew: it restarted, or another one "
                    "answers",
                )
            return False
        false = self._false_step(self._last, _Arrived(report, now))
        if false:
            self._reject(now, false)
            return False
        self._turn(report)
        self._use(_Arrived(report, now))
        return not self.withheld

    def _take_withheld(self, arrived: _Arrived) -> bool:
        """Take a report after false ones."""
        assert self._withheld_since is not None
        previous, self._previous = self._previous, arrived
        if previous is None or self._false_step(previous, arrived):
            self._withheld_since = arrived.at
        if not self._greeted or arrived.at - self._withheld_since < WITHHELD:
            return False
        self._withheld_since = self._previous = None
        if self._last is not None and not self._false_step(self._last, arrived):
            self._turn(arrived.report)
        elif self._last is not None:
            self._board_time += arrived.at - self._last.at
        self._offsets.clear()
        self._use(arrived)
        return not self.withheld

    def _false_step(self, before: _Arrived, after: _Arrived) -> str:
        """Return why a report cannot follow another one; empty: it can."""
        if not _is_newer(after.report, before.report):
            return "the reports of the motor board are not in order"
        passed = stamp_difference(after.report.stamp, before.report.stamp)
        if passed > after.at - before.at + _AHEAD:
            return f"the stamps of the motor board jump by {passed:.3g} s"
        maximum = SPEED_MARGIN * self._fastest * passed + SLACK + 2.0 * self._unit
        for i, (now, then) in enumerate(
            zip(after.report.counts, before.report.counts, strict=True)
        ):
            angle = self._unit * abs(count_difference(now, then))
            if angle > maximum:
                return (
                    f"the motor board reports that wheel {i} turned by {angle:.3g} rad in "
                    f"{passed:.3g} s, more than {SPEED_MARGIN:g} times its largest speed"
                )
        return ""

    def _turn(self, report: Report) -> None:
        """Add what the wheels turned since the last report that is used."""
        assert self._last is not None
        last = self._last.report
        self.lost += sequence_difference(report.sequence, last.sequence) - 1
        self._board_time += stamp_difference(report.stamp, last.stamp)
        for i, (now, before) in enumerate(zip(report.counts, last.counts, strict=True)):
            self._turned[i] += count_difference(now, before)

    def _use(self, arrived: _Arrived) -> None:
        """Use a report; withhold the next ones if a wheel is stuck."""
        counts, now = arrived.report.counts, arrived.at
        before = self._last.report.counts if self._last else ()
        self._last, self._older, self.fault = arrived, 0, ""
        self._offsets.append(now - self._board_time)
        for i, since in enumerate(self._still_since):
            if since is None:
                continue
            if not before or counts[i] != before[i]:
                self._still_since[i] = now
            elif now - since >= STUCK_TIME:
                self._withhold(
                    now,
                    f"the count of wheel {i} has not changed for {now - since:.2f} s, although it "
                    f"is commanded to turn with {self._commanded[i]:.3g} rad/s",
                )

    def _reject(self, now: float, fault: str) -> None:
        """Ignore a false report, and withhold the next ones if there are several."""
        self._false.append(now)
        if self.withheld:
            self._withheld_since, self._previous = now, None
            return
        self.fault = fault
        if len(self._false) == _MAX_FALSE and now - self._false[0] <= WITHHELD:
            self._withhold(now, fault)

    def _withhold(self, now: float, fault: str) -> None:
        """Use no report until the board greets as at first, and its reports follow one another."""
        self.fault = fault
        self._greeted = False
        self._withheld_since, self._previous = now, None
        self._older = 0
        self._still_since = [None] * self._hello.wheels


def _is_newer(report: Report, before: Report) -> bool:
    return (
        sequence_difference(report.sequence, before.sequence) > 0
        and stamp_difference(report.stamp, before.stamp) > 0.0
    )
