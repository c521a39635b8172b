"""Misuse of the Python interface: one sentence each, with the way out.

The calls run in a process without run-time type checks, as users run them.
"""

import json
import subprocess
import sys

import pytest

CODE = """
import json, sys
import numpy as np
import omnidrive as od
from omnidrive.simulation import CoppeliaSimPlant

robot, rest = od.named_robot("small"), od.Pose(0.0, 0.0, 0.0)
feedforward = od.FeedforwardController(0.1)
plant, hold = od.KinematicPlant(robot), od.Hold(od.Pose(0.5, 0.0, 0.0), 1.0)


class Constant:
    def __init__(self, command):
        self.command = command

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return self.command


def run(controller, reference=hold, start=rest, dt=0.1, plant=plant, sensors=None):
    return od.simulate(plant, controller, reference, start=start, dt=dt, sensors=sensors).ending


def batch(plant=plant, controller=feedforward, references=(hold,), **options):
    return list(od.simulate_batch(plant, controller, references, dt=0.1, **options))


def returning(command):
    return lambda: run(Constant(command))


class Unconnected(od.KinematicPlant):
    @property
    def capabilities(self):
        raise RuntimeError("not connected")


grid = od.OccupancyGrid(np.zeros((9, 9), bool), 1.0)
CALLS = {
    "tuple": returning((0.1, 0.0, 0.0)),
    "none": returning(None),
    "world twist": returning(od.WorldTwist(0.1, 0.0, 0.0)),
    "command of a world twist": returning(od.Command(od.WorldTwist(0.1, 0.0, 0.0))),
    "body twist": returning(od.BodyTwist(0.1, 0.0, 0.0)),
    "wheel speeds": returning(od.WheelSpeeds([1.0] * 4)),
    "command of a list": returning(od.Command([1.0, 0.0, 0.0])),
    "start in degrees": lambda: run(feedforward, start=od.Pose(0.0, 0.0, 90.0)),
    "reference in degrees": lambda: run(feedforward, od.Hold(od.Pose(0.0, 0.0, -45.0), 1.0)),
    "waypoint in degrees": lambda: od.plan(
        grid, od.Waypoint(1, 1), od.Waypoint(7, 7, 90), inflation=0.0, options=od.PathOptions()
    ),
    "start as a tuple": lambda: run(feedforward, start=(0.0, 0.0, 0.0)),
    "other sample time": lambda: run(feedforward, dt=0.05),
    "class": lambda: run(od.FeedforwardController),
    "no controller": lambda: run(robot),
    "capabilities raise": lambda: run(feedforward, plant=Unconnected(robot)),
    "plant class": lambda: run(feedforward, plant=od.KinematicPlant),
    "no plant": lambda: run(feedforward, plant=robot),
    "sensors class": lambda: run(feedforward, sensors=od.PerfectSensors),
    "no sensors": lambda: run(feedforward, sensors=rest),
    "kinematic of a chassis": lambda: od.KinematicPlant(robot.chassis),
    "planar of a chassis": lambda: od.PlanarPlant(robot.chassis),
    "mujoco of a name": lambda: od.MujocoPlant("small"),
    "coppeliasim of a chassis": lambda: CoppeliaSimPlant(robot.chassis),
    "batch of a robot": lambda: batch(plant=robot),
    "batch of one reference": lambda: batch(references=hold),
    "batch from one start": lambda: batch(starts=rest),
    "batch with other sensors": lambda: batch(sensors=od.PerfectSensors()),
    "batch with an estimator": lambda: batch(controller=od.Pipeline(feedforward)),
    "two turns": lambda: run(feedforward, start=od.Pose(0.0, 0.0, 12.5)),
    "built for the loop": lambda: run(od.FeedforwardController(0.1 + 1e-9)),
}
found = {}
for name, call in CALLS.items():
    try:
        found[name] = ["", call()]
    except od.OmnidriveError as error:
        found[name] = [type(error).__name__, str(error)]
print(json.dumps(found, default=str))
"""

RETURN = "the controller had no usable command: "
EXPECTED = {
    "tuple": ("", RETURN + "it returned a tuple, not a Command: return Command(BodyTwist(vx, vy, "
              "yaw_rate))"),
    "none": ("", RETURN + "it returned None, not a Command: return Command(BodyTwist(vx, vy, "
             "yaw_rate))"),
    "world twist": ("", RETURN + "it returned a WorldTwist, not a Command: return "
                    "Command(to_body(twist, state.pose.yaw))"),
    "command of a world twist": ("", RETURN + "its command holds a WorldTwist, not a BodyTwist, "
                                 "WheelSpeeds or WheelTorques: return Command(to_body(twist, "
                                 "state.pose.yaw))"),
    "body twist": ("", RETURN + "it returned a BodyTwist, not a Command: return "
                   "Command(BodyTwist(...))"),
    "wheel speeds": ("", RETURN + "it returned a WheelSpeeds, not a Command: return "
                     "Command(WheelSpeeds(...))"),
    "command of a list": ("", RETURN + "its command holds a list, not a BodyTwist, WheelSpeeds or "
                          "WheelTorques: return Command(BodyTwist(vx, vy, yaw_rate))"),
    "start in degrees": ("InvalidInput", "the start's heading is 90 rad, more than two turns: "
                         "headings are in rad, not degrees (90 degrees are 1.5708 rad); if it is "
                         "meant, wrap it with omnidrive.wrap"),
    "reference in degrees": ("InvalidInput", "the reference's heading at its start is -45 rad"),
    "waypoint in degrees": ("InvalidInput", "the goal's heading is 90 rad, more than two turns"),
    "start as a tuple": ("InvalidInput", "the start is a tuple: pass Pose(x, y, yaw), in m, m"),
    "other sample time": ("InvalidInput", "the controller is built for a sample time of 0.1 s, but "
                          "the loop runs with dt=0.05 s: build the controller with dt=0.05, or "
                          "simulate with dt=0.1"),
    "class": ("InvalidInput", "the controller is the class FeedforwardController: pass an object, "
              "such as FeedforwardController()"),
    "no controller": ("InvalidInput", "a controller needs the methods reset(state) and step(t, "
                      "state, reference): Robot has no reset and no step"),
    "capabilities raise": ("", "the plant failed: RuntimeError: not connected"),
    "plant class": ("InvalidInput", "as plant the class KinematicPlant is given: pass an object"),
    "no plant": ("InvalidInput", "plant: need an object with capabilities, reset, step, close; "
                 "Robot has no capabilities and no reset and no step and no close"),
    "sensors class": ("InvalidInput", "as sensors the class PerfectSensors is given: pass an ob"),
    "no sensors": ("InvalidInput", "sensors: need an object with reset, apply, read; Pose has no "),
    "kinematic of a chassis": ("InvalidInput", "KinematicPlant needs a Robot, got a Chassis: pass "
                               "the robot itself"),
    "planar of a chassis": ("InvalidInput", "PlanarPlant needs a Robot, got a Chassis: pass the "
                            "robot itself"),
    "mujoco of a name": ("InvalidInput", "MujocoPlant needs a Robot, got a str: pass "
                         "od.named_robot('small')"),
    "coppeliasim of a chassis": ("InvalidInput", "CoppeliaSimPlant needs a Robot, got a Chassis"),
    "batch of a robot": ("InvalidInput", "a batch of closed loops starts with a plant; a batch of "
                         "given commands, without controller, is simulate_commands(robot, starts"),
    "batch of one reference": ("InvalidInput", "references must be a sequence, one for each run, "
                               "got a Hold: for the same in every run pass itertools.repeat(it"),
    "batch from one start": ("InvalidInput", "starts must be a sequence, one for each run, got a "
                             "Pose"),
    "batch with other sensors": ("InvalidInput", "a batch simulates exact poses (sensors=None) and "
                                 "the paper's noise (sensors=PaperNoise, the class), got Perf"),
    "batch with an estimator": ("InvalidInput", "a batch takes a controller, not a pipeline: its "
                                "state estimate is the latest pose fix (LatestFix)"),
    "two turns": ("", "reached the end of the reference"),
    "built for the loop": ("", "reached the end of the reference"),
}  # fmt: skip


@pytest.fixture(scope="module")
def found():
    done = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, check=True, timeout=300
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", EXPECTED)
def test_misuse_is_one_sentence_with_the_way_out(found, name):
    kind, message = found[name]
    expected_kind, text = EXPECTED[name]
    assert kind == expected_kind
    assert message.startswith(text)
    assert "\n" not in message


def test_every_call_is_checked(found):
    assert set(found) == set(EXPECTED)
