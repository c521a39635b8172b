"""Progress of a drive along its reference."""

from __future__ import annotations

from dataclasses import dataclass, field

from omnidrive.control import Pipeline
from omnidrive.deploy.remaining_reference import RemainingReference
from omnidrive.reference import Reference, SplicedReference


@dataclass(slots=True)
class DriveProgress:
    """Progress of a drive along its reference, in segments from each start to the next hold.

    Attributes:
        reference: The whole motion; after a segment with continuations, that of this segment.
        dt: Sample time, s.
        first: Number of the sample with which the present segment begins.
        last: Number of the last sample of the segment, counted from its first.
        tracked: What remained of the reference when the segment began, and its continuations.
        governed: What the controller tracks instead.
        done: Time of this motion that former segments tracked, s.
    """

    reference: Reference
    dt: float
    first: int = 0
    last: int = 0
    tracked: Reference = field(init=False)
    governed: Reference = field(init=False)
    done: float = 0.0
    _logged: float = 0.0
    """Time of the log at which the present segment begins, s."""

    def __post_init__(self) -> None:
        self.tracked = self.governed = self.reference

    def begin(self, number: int, pipeline: Pipeline) -> None:
        """Begin a segment with the sample ``number``; ``pipeline`` may delay the reference."""
        if isinstance(self.tracked, SplicedReference):
            self.reference = self.tracked
        if self.done:
            self.tracked = RemainingReference(self.reference, self.done)
        self.first = number
        self._govern(pipeline)

    def continue_along(self, reference: SplicedReference, pipeline: Pipeline) -> None:
        """Track another motion in the present segment; its first part is the tracked one."""
        self.tracked = reference
        self._govern(pipeline)

    def _govern(self, pipeline: Pipeline) -> None:
        self.governed = pipeline.retime(self.tracked).reference
        duration = max(self.tracked.duration, self.governed.duration)
        self.last = round(duration / self.dt)

    def end(self, number: int) -> None:
        """End the segment with the sample ``number``, before the end of the reference."""
        t = (number - self.first) * self.dt
        tracked = self.tracked
        if isinstance(tracked, RemainingReference):
            self.done += tracked.progress(t)
        else:  # the segment began with its begin
            self.done = t
        self._logged += t + self.dt

    def log_time(self, t: float) -> float:
        """Return the time of the log, s, of the time ``t`` (s) of the segment."""
        return self._logged + t
