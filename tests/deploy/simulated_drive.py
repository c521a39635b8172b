"""Drives of a simulated robot on simulated time, for tests."""

from dataclasses import dataclass, field

from omnidrive import FeedforwardController, KinematicPlant, PerfectSensors, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.drive import drive
from omnidrive.deploy.links.simulated import SimulatedLink, SimulatedRobot
from omnidrive.reference import RetimedReference

DT = 0.05
ROBOT = named_robot("small")
START = Pose(0.0, 0.0, 0.0)


def circle(duration=6.0):
    from omnidrive.components import configure
    from omnidrive.reference import ReferenceContext

    made = configure("references", "circle", {"radius": 0.5}).make(ReferenceContext(ROBOT, START))
    return RetimedReference(made, duration)


def controller():
    return FeedforwardController(DT)


@dataclass(slots=True)
class Link(SimulatedLink):
    """A simulated link whose calls tests can change; it keeps what was sent."""

    on_read: list = field(default_factory=list)
    on_send: list = field(default_factory=list)
    sent: list = field(default_factory=list)
    stops: int = 0
    closed: bool = False

    def read(self):
        readings = SimulatedLink.read(self)
        for change in self.on_read:
            readings = change(self, readings)
        return readings

    def send(self, value):
        for act in self.on_send:
            act(self, value)
        self.sent.append((self._clock.now(), value))
        SimulatedLink.send(self, value)

    def stop(self):
        self.stops += 1
        SimulatedLink.stop(self)

    def close(self):
        self.closed = True
        SimulatedLink.close(self)


def link(sensors=None):
    return Link(SimulatedRobot(ROBOT, KinematicPlant(ROBOT), sensors or PerfectSensors()), START)


def driven(made, reference=None, controls=None, ours=None, start=START, clock=None, log=None):
    return drive(
        made,
        Pipeline(ours or controller()),
        reference or circle(),
        rate=1.0 / DT,
        start=start,
        controls=controls,
        clock=clock or SimulatedClock(),
        log=log,
    )
