"""The pipeline from sensor readings to the command."""

import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, Pipeline, Status, holonomic_nmpc
from omnidrive.control.supervision import (
    NullSupervisor,
    SafetySupervisor,
    Supervisor,
    Watchdog,
    WatchdogLimits,
    WheelMonitor,
)
from omnidrive.errors import InvalidInput
from omnidrive.estimation import LatestFix, PoseEstimator, PoseFix, SensorReadings, SensorSettings
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import MujocoPlant, SensorSuite, simulate
from omnidrive.testing.laws import Circle

DT = 0.1
ROBOT = named_robot("small")
START = Circle().at(0.0).pose


def pipeline():
    """Filter, supervisor and NMPC."""
    return Pipeline(
        holonomic_nmpc(ROBOT.chassis, DT),
        PoseEstimator(ROBOT),
        SafetySupervisor(ROBOT, Watchdog(WatchdogLimits.of(ROBOT)), WheelMonitor(ROBOT)),
    )


def sensors():
    return SensorSuite(SensorSettings(), ROBOT.chassis, np.random.default_rng(4))


def test_two_drivers_of_one_pipeline_give_the_same_commands():
    """``simulate`` and a loop that has readings only, as a robot's link does."""
    plant = MujocoPlant(ROBOT, "ball")
    log = simulate(plant, pipeline(), Circle(), start=START, dt=DT, sensors=sensors())
    line, suite, state, commands = pipeline(), sensors(), plant.reset(START), []
    line.prepare()
    line.reset(START)
    suite.reset(START)
    for k in range(len(log.t) - 1):
        step = line.step(k * DT, suite.read(k * DT, state), Circle(), DT)
        commands.append(step.command.twist)
        state = plant.step(step.command.twist, DT)
    assert np.array(commands).tobytes() == log.command[:-1].tobytes()


def test_late_command_is_that_of_the_previous_sample():
    line = Pipeline(FeedforwardController(DT))
    line.reset(START)
    readings = [
        SensorReadings(k * DT, fixes=(PoseFix(k * DT, Circle().at(k * DT).pose, 0.0, 0.0),))
        for k in range(3)
    ]
    first = line.step(0.0, readings[0], Circle(), DT).command
    assert line.step(DT, readings[1], Circle(), DT, late=True).command == first
    assert line.step(2 * DT, readings[2], Circle(), DT).command != first


def test_readings_without_fix_keep_the_pose_and_age_it():
    line = Pipeline(FeedforwardController(DT))
    line.reset(START)
    state = line.step(0.7, SensorReadings(0.7), Circle(), DT).state
    assert state.pose == START
    assert state.fix_age == pytest.approx(0.7)


def test_failure_is_a_step_with_the_part_that_failed():
    class Broken(FeedforwardController):
        def step(self, t, state, reference):
            raise ZeroDivisionError("law")

    line = Pipeline(Broken(DT))
    line.reset(START)
    step = line.step(0.0, SensorReadings(0.0), Circle(), DT)
    assert step.failed == "controller"
    assert step.command.status is Status.FAILED
    assert step.command.twist == BodyTwist(0.0, 0.0, 0.0)
    assert "ZeroDivisionError: law" in step.command.message
    line.estimator = None
    assert line.step(0.0, SensorReadings(0.0), Circle(), DT).failed == "estimator"


def test_failing_reference_is_reported():
    class Broken(Hold):
        def at(self, t):
            raise RuntimeError("beyond the end")

    line = Pipeline(FeedforwardController(DT))
    line.reset(START)
    step = line.step(0.0, SensorReadings(0.0), Broken(START, 1.0), DT)
    assert step.failed == "reference"


def test_failing_supervisor_is_reported():
    class Broken(NullSupervisor):
        def limit(self, command, dt):
            raise RuntimeError("limit")

    line = Pipeline(FeedforwardController(DT), supervisor=Broken())
    line.reset(START)
    assert line.step(0.0, SensorReadings(0.0), Circle(), DT).failed == "supervisor"


def test_supervisors_satisfy_the_protocol():
    for supervisor in (NullSupervisor(), SafetySupervisor(ROBOT)):
        supervisor.reset(FeedforwardController(DT))
        assert isinstance(supervisor, Supervisor)
    command = Command(BodyTwist(1.0, 2.0, 3.0))
    assert NullSupervisor().limit(command, DT) is command


def test_pipeline_holds_its_own_estimator():
    with pytest.raises(InvalidInput, match="a pipeline holds its own estimator"):
        simulate(
            MujocoPlant(ROBOT, "ball"),
            pipeline(),
            Hold(Pose(0.0, 0.0, 0.0), 1.0),
            start=START,
            dt=DT,
            estimator=LatestFix(),
        )


def test_controller_prepares_once_before_the_run():
    calls = []

    class Preparable(FeedforwardController):
        def prepare(self):
            calls.append("prepare")

        def reset(self, state):
            calls.append("reset")

    simulate(MujocoPlant(ROBOT, "ball"), Preparable(DT), Hold(START, 0.3), start=START, dt=DT)
    assert calls == ["prepare", "reset"]
