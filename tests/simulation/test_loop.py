"""The closed loop under faults and supervision."""

from math import pi

import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, Status
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.errors import InvalidInput, RunFailed
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold, SampledReference
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    KinematicPlant,
    MujocoPlant,
    Outcome,
    PaperNoise,
    PlantCapabilities,
    Schedule,
    parse_fault,
    simulate,
)

DT = 0.1
ROBOT = named_robot("paper")
AT_REST = Hold(Pose(0.0, 0.0, 0.0), 3.0)


def circle(duration=12.0, radius=1.5, speed=0.7):
    """Return a circle from rest with tangential heading."""
    t = np.linspace(0.0, duration, 1201)
    angle = speed / radius * (t - 1.0 + np.exp(-t))
    rate = speed / radius * (1.0 - np.exp(-t))
    poses = np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle], axis=1)
    twists = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.ones_like(t)], axis=1)
    return SampledReference(t, poses, rate[:, None] * twists)


CIRCLE = circle()


def supervisor(robot=ROBOT):
    return SafetySupervisor(robot, Watchdog(WatchdogLimits.of(robot)), WheelMonitor(robot))


def run(*faults, plant="ball", reference=CIRCLE, supervised=True, controller=None, sensors=None):
    built = KinematicPlant(ROBOT) if plant == "kinematic" else MujocoPlant(ROBOT, plant)
    return simulate(
        built,
        controller or FeedforwardController(DT),
        reference,
        start=reference.at(0.0).pose,
        dt=DT,
        sensors=sensors,
        schedule=Schedule(tuple(map(parse_fault, faults)), ROBOT) if faults else None,
        supervisor=supervisor() if supervised else None,
        rng=np.random.default_rng(1),
    )


def errors(log):
    return np.hypot(*(log.pose - log.target)[:, :2].T)


def descriptions(log):
    return [event.what for event in log.events]


def test_supervisor_does_not_change_the_run_of_a_healthy_robot():
    plain, supervised = run(supervised=False), run()
    for name in ("pose", "command", "twist", "work"):
        assert getattr(plain, name).tobytes() == getattr(supervised, name).tobytes()
    assert supervised.events == ()
    assert supervised.outcome is Outcome.FINISHED


def test_faults_are_reproducible():
    kinds = ("push:at=1", "period-jitter:at=2", "wheel-dead:at=3,wheel=1")
    one, two = run(*kinds), run(*kinds)
    assert one.pose.tobytes() == two.pose.tobytes()
    assert one.events == two.events


def test_log_contains_start_and_end_of_faults():
    log = run("slope:at=1,duration=2", "push:at=0", reference=AT_REST)
    assert [(round(e.t, 9), e.what) for e in log.events] == [
        (0.0, "push begins"), (1.0, "slope begins"),
    ]  # fmt: skip
    log = run("slope:at=1,duration=1", reference=AT_REST)
    assert (2.0, "slope ends") in [(round(e.t, 9), e.what) for e in log.events]


@pytest.mark.parametrize(
    ("wheel", "plant"),
    [
        (0, "ball"),
        pytest.param(2, "ball", marks=pytest.mark.long),
        pytest.param(0, "rollers", marks=pytest.mark.long),
        pytest.param(2, "rollers", marks=pytest.mark.long),
    ],
)
def test_position_is_controlled_with_a_locked_wheel(plant, wheel):
    fault = f"wheel-locked:at=3,wheel={wheel}"
    log = run(fault, plant=plant)
    finding = log.events[1]
    assert (
        finding.what == f"wheel {wheel} is locked; the position is controlled, the heading is not"
    )
    assert 3.2 <= finding.t <= 3.6
    assert errors(log).max() < 0.1
    assert errors(log)[log.t > finding.t + 1.5].max() < 0.02
    heading_error = log.pose[-1, 2] - log.target[-1, 2]
    assert abs(heading_error) > 0.2


def test_locked_wheel_without_a_supervisor_displaces_the_robot():
    assert errors(run("wheel-locked:at=3,wheel=1", supervised=False)).max() > 0.15


@pytest.mark.parametrize("plant", ["ball", pytest.param("rollers", marks=pytest.mark.long)])
def test_dead_wheel_is_detected_and_compensated(plant):
    log = run("wheel-dead:at=3,wheel=1", plant=plant)
    assert log.events[1].what.startswith("wheel 1 is dead; the other 3 compensate for it")
    assert errors(log)[log.t > 3.0].max() < 0.02
    assert log.outcome is Outcome.FINISHED


def test_dead_encoder_is_only_reported():
    log = run("encoder-dead:at=3,wheel=1")
    assert descriptions(log) == ["encoder-dead begins", "wheel 1 has a dead encoder"]
    assert log.pose.tobytes() == run("encoder-dead:at=3,wheel=1", supervised=False).pose.tobytes()


def test_kidnapped_robot_returns_to_the_reference():
    log = run("pose-jump:at=3,distance=0.5", plant="kinematic")
    assert errors(log)[31] == pytest.approx(0.5, abs=0.1)
    assert errors(log)[-1] < 0.01


def test_controllers_receive_the_last_fix_while_fixes_are_silent():
    log = run("sensor-silent:at=2,duration=1", plant="kinematic", supervised=False)
    assert np.ptp(log.measured[19:30], axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.0)
    assert log.measured[30] == pytest.approx(log.pose[30])
    assert errors(log)[-1] < 0.01


def test_long_silence_of_fixes_stops_the_robot():
    log = run("sensor-silent:at=2,duration=9", plant="kinematic")
    assert log.outcome is Outcome.STOPPED
    assert "its pose is lost: last fix 1.9" in log.reason
    assert 3.5 < log.t[-1] < 6.0
    assert np.abs(log.twist[-1]).max() == 0.0


def test_noise_continues_after_silence():
    noise = PaperNoise(np.random.default_rng(3))
    log = run("sensor-silent:at=2,duration=1", plant="kinematic", sensors=noise)
    assert np.ptp(log.measured[20:30, 0]) == 0.0
    assert np.ptp((log.measured - log.pose)[30:, 0]) > 0.01


def test_overrun_holds_the_previous_command():
    on_time = run(plant="kinematic", reference=CIRCLE).command
    log = run("solver-overrun:at=4,duration=0.1", plant="kinematic")
    assert log.command[40].tolist() == on_time[39].tolist()
    assert log.command[:40].tolist() == on_time[:40].tolist()


def test_log_and_reference_use_the_true_time_with_jitter():
    log = run("period-jitter:at=1,spread=0.5", plant="kinematic")
    assert np.diff(log.t).std() > 0.01
    for t, target in zip(log.t[::10], log.target[::10], strict=True):
        assert target == pytest.approx(CIRCLE.at(float(t)).pose)
    moved = np.diff(log.pose[:, 2])
    assert moved == pytest.approx(log.command[:-1, 2] * np.diff(log.t), abs=1e-9)


class Runaway:
    """A controller that drives forward at full speed from 2 s on."""

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return Command(BodyTwist(2.0 if t >= 2.0 else 0.0, 0.0, 0.0), Status.OK)


@pytest.mark.parametrize("plant", ["ball", "kinematic"])
def test_watchdog_stops_a_runaway_controller(plant):
    log = run(plant=plant, reference=Hold(Pose(0.0, 0.0, 0.0), 20.0), controller=Runaway())
    assert log.outcome is Outcome.STOPPED
    assert "m from the reference, more than 1.50 m" in log.reason
    assert descriptions(log)[-1].startswith("the watchdog stops the robot")
    assert 2.5 < log.t[-1] < 5.0
    assert np.abs(log.twist[-1]).max() < 0.01  # at rest
    braking = np.diff(log.command[log.t > 3.2], axis=0)
    assert np.abs(braking @ ROBOT.acceleration_faces.T).max() <= DT
    with pytest.raises(RunFailed, match="the watchdog stopped the robot: at"):
        log.raise_if_failed()


def test_faults_after_the_end_or_unsupported_by_the_plant_are_rejected():
    with pytest.raises(InvalidInput, match="push begins at 3 s, but the run ends at 3 s"):
        run("push:at=3", reference=AT_REST)

    class OtherPlant:
        capabilities = PlantCapabilities()

        def reset(self, pose):
            raise AssertionError

        step = close = reset

    with pytest.raises(InvalidInput, match="this plant is not disturbable, so no push"):
        simulate(
            OtherPlant(), FeedforwardController(DT), AT_REST, start=Pose(0.0, 0.0, 0.0), dt=DT,
            schedule=Schedule((parse_fault("push:at=1"),), ROBOT),
        )  # fmt: skip


def test_consecutive_pushes_both_act():
    once = run("push:at=1,direction=0", reference=AT_REST, supervised=False)
    twice = run("push:at=1,direction=0", "push:at=1.1,direction=0", reference=AT_REST)
    assert twice.pose[12, 0] > once.pose[12, 0] + 0.005
    assert abs(twice.pose[-1, 2]) < 0.1 * pi
