"""Identification of a robot from the log of a drive."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

pytest.importorskip("mcap")

from omnidrive import PlanarPlant, Pose, named_robot
from omnidrive.control import Command, Pipeline, WheelTorques
from omnidrive.deploy import SimulatedClock, SimulatedLink, SimulatedRobot, drive
from omnidrive.deploy.identification_log import _robot_log, identification_log
from omnidrive.deploy.log import DriveLog, read_log
from omnidrive.errors import InvalidLog
from omnidrive.estimation import PoseFix, SensorReadings
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold
from omnidrive.simulation.identification import identification_commands, identify_robot

DT = 0.02
NOMINAL = named_robot("small")
TRUE = replace(NOMINAL, wheel=replace(NOMINAL.wheel, radius=0.048))


@dataclass
class Sensors:
    """Exact poses and wheel angles."""

    angles: np.ndarray = field(default_factory=lambda: np.zeros(4))
    last: float = 0.0
    silent: tuple = (9e9, 9e9)

    def reset(self, pose):
        self.angles[:] = 0.0

    def read(self, t, state):
        self.angles += (t - self.last) * np.array(state.wheel_speeds)
        self.last = t
        fixes = (PoseFix(t, state.pose, 1e-3, 1e-3),)
        if self.silent[0] <= t < self.silent[1]:
            fixes = ()
        return SensorReadings(t, tuple(self.angles.tolist()), fixes=fixes)


class Commands:
    """Commands that determine the robot, whatever the reference is."""

    def __init__(self, rows):
        self.rows, self.dt = rows, DT

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return Command(BodyTwist(*self.rows[round(t / DT)].tolist()))


def write_log(path, duration, silent=(9e9, 9e9)):
    rows = identification_commands(TRUE, np.random.default_rng(5), DT, duration + 1.0)
    link = SimulatedLink(
        SimulatedRobot(TRUE, PlanarPlant(TRUE), Sensors(silent=silent)), Pose(0.0, 0.0, 0.0)
    )
    drive(
        link,
        Pipeline(Commands(rows)),
        Hold(Pose(0.0, 0.0, 0.0), duration),
        rate=1.0 / DT,
        clock=SimulatedClock(),
        log=DriveLog(path),
    )
    return link


def test_log_holds_poses_commands_and_wheel_speeds(tmp_path):
    link = write_log(tmp_path / "a.mcap", 6.0, silent=(1.0, 1.1))
    log = identification_log(read_log(tmp_path / "a.mcap"))
    begin = round(1.1 / DT)  # the longest stretch with fixes
    assert len(log.t) == round(6.0 / DT) + 1 - begin
    np.testing.assert_allclose(log.t, DT * np.arange(len(log.t)), atol=1e-9)
    poses = np.array([state.pose for state in link.states])
    np.testing.assert_array_equal(log.poses, poses[begin : begin + len(log.t)])
    speeds = np.array([state.wheel_speeds for state in link.states])[begin : begin + len(log.t)]
    assert np.sqrt(np.mean((log.wheel_speeds - speeds) ** 2)) < 0.05 * np.abs(speeds).max()


@pytest.mark.long
def test_changed_robot_is_identified_from_the_log_of_a_drive(tmp_path):
    write_log(tmp_path / "a.mcap", 60.0)
    found = identify_robot(identification_log(read_log(tmp_path / "a.mcap")), NOMINAL)
    assert found.robot.wheel.radius == pytest.approx(0.048, rel=2e-3)
    assert found.robot.lag[0] == pytest.approx(TRUE.lag[0], abs=0.01)


def test_log_without_fixes_or_with_torques_is_refused(tmp_path):
    write_log(tmp_path / "a.mcap", 0.5, silent=(0.01, 9e9))
    logged = read_log(tmp_path / "a.mcap")
    with pytest.raises(InvalidLog, match=r"no samples with commands and measured poses .*--rate"):
        identification_log(logged)

    fix = PoseFix(0.0, Pose(0.0, 0.0, 0.0), 1e-3, 1e-3)
    still = SensorReadings(0.0, fixes=(fix,))
    torques = [
        sample._replace(read=still, sent=WheelTorques([0.0] * 4)) for sample in logged.samples()
    ]
    with pytest.raises(InvalidLog, match="commands wheel torques"):
        _robot_log(torques, NOMINAL, DT)
