"""A process that drives a simulated robot in real time with a log, until it is killed."""

import sys
import time
from dataclasses import dataclass

from omnidrive import FeedforwardController, Hold, KinematicPlant, PerfectSensors, Pose
from omnidrive.control import Pipeline
from omnidrive.deploy.drive import drive
from omnidrive.deploy.links.simulated import SimulatedLink, SimulatedRobot
from tests.deploy.simulated_drive import ROBOT, START

RATE = 100.0


@dataclass(slots=True)
class WallLink(SimulatedLink):
    """A plant in this process that moves with the monotonic clock."""

    def open(self, clock):
        self._clock = clock
        self._state = self.simulated.plant.reset(self.start)
        self.simulated.sensors.reset(self.start)


def main(path):
    """Drive for a minute."""
    link = WallLink(SimulatedRobot(ROBOT, KinematicPlant(ROBOT), PerfectSensors()), START)
    pipeline, reference = Pipeline(FeedforwardController(1.0 / RATE)), Hold(Pose(0.1, 0.0, 0.0), 60)
    print(f"ready {time.monotonic()}", flush=True)
    drive(link, pipeline, reference, rate=RATE, start=START, log=path)


if __name__ == "__main__":
    main(sys.argv[1])
