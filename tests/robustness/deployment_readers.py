"""Readers of logs of drives, and of what robots, hosts and nodes send."""

from __future__ import annotations

import json

from omnidrive.control import Pipeline, WheelSpeeds
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.drive import drive
from omnidrive.deploy.identification_log import identification_log
from omnidrive.deploy.links.lekiwi import action, parse_observation
from omnidrive.deploy.links.wheel_counts import WheelCounts
from omnidrive.deploy.links.wheel_protocol import (
    Hello,
    Report,
    command_line,
    hello_request,
    parse,
)
from omnidrive.deploy.log import DriveLog, read_log
from omnidrive.deploy.log.logged_event import Continued, Dropped, decode_event, encode_event
from omnidrive.deploy.log.logged_sample import decode_sample, encode_sample
from omnidrive.deploy.ros2.drive_files import parameters_file
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.errors import InvalidInput
from omnidrive.files.bounded_file import read_bounded
from omnidrive.geometry import BodyTwist
from omnidrive.ros2 import decode, encode, message_type
from omnidrive.ros2.planar_messages import grid_of, pose_of, twist_of
from tests.deploy.board import hello_line, is_hello_request, parse_command, report_line
from tests.deploy.simulated_drive import DT, START, circle, controller, link
from tests.robustness.reader import Reader

HELLO = Hello(1, 4, 4096, 0.3)


def deployment_readers(folder):
    """Return the readers by name."""
    path = folder / "drive.mcap"
    drive(
        link(), Pipeline(controller()), circle(0.5), rate=1.0 / DT, start=START,
        clock=SimulatedClock(), log=DriveLog(path),
    )  # fmt: skip
    log = read_log(path)
    samples = list(log.samples())
    samples[3] = samples[3]._replace(sent=WheelSpeeds((1.0, -1.0, 0.5, 2.0)))
    events = (*log.changes, *log.segments, Dropped(3), Continued(4, 0.2, "a.csv"))
    messages = _messages()
    readers = {
        "drive log": Reader("log.mcap", (path.read_bytes(),), _log),
        "logged sample": _of_bytes(map(encode_sample, samples[:5]), decode_sample),
        "logged event": _of_bytes((encode_event(e, 5, 6) for e in events), decode_event),
        "parameters": Reader(
            "p.yaml",
            (parameters_file(DriveSettings()), b"/**:\n  ros__parameters:\n    rate: 20.0\n"),
            lambda path: DriveSettings().with_values(read_parameters(path)),
        ),
        "wheel lines": _of_bytes(_lines(), _wheels),
        "lekiwi": _of_bytes(_observations(), parse_observation),
    }
    for name, message in messages.items():
        readers[name] = _of_bytes((encode(message),), lambda data, name=name: _use(data, name))
    return readers


def _of_bytes(valid, read):
    """Return a reader of bytes that no file holds."""
    return Reader(
        "message",
        tuple(valid),
        lambda path: read(
            read_bounded(path, 4_000_000, "message", InvalidInput, excess="is too large")
        ),
    )


def _log(path):
    log = read_log(path)
    list(log.samples())
    log.timing()
    log.run()
    identification_log(log)


def _lines():
    reports = [Report(k, 20_000 * k, k, (k, -k, 7 * k, 0)) for k in range(6)]
    return (
        hello_line(HELLO) + b"".join(map(report_line, reports)),
        hello_request() + command_line(5, (0.5, -1.0, 2.0, 0.0)),
    )


def _wheels(data):
    counts = WheelCounts(HELLO, 10.0)
    for k, line in enumerate(data.split(b"\n")[:10_000]):
        is_hello_request(line)
        parse_command(line)
        said = parse(line)
        if isinstance(said, Hello):
            counts.greet(said, 0.02 * k)
        elif isinstance(said, Report) and counts.take(said, 0.02 * k):
            assert all(abs(angle) < 1e9 for angle in counts.angles)


def _observations():
    arm = {"arm_shoulder_pan.pos": -3.25, "arm_gripper.pos": 12.0}
    data = action(arm, BodyTwist(0.1, -0.05, 0.3))
    return data, json.dumps({**json.loads(data), "_cams": ["front"], "front": 200 * "A"}).encode()


def _messages():
    names = (
        *("nav_msgs/msg/Odometry", "nav_msgs/msg/Path", "nav_msgs/msg/OccupancyGrid"),
        *("sensor_msgs/msg/JointState", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"),
        *("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    )
    made = {name: message_type(name)() for name in names}
    grid = made["nav_msgs/msg/OccupancyGrid"]
    grid.info.resolution, grid.info.width, grid.info.height = 0.05, 3, 2
    grid.data = [0, 100, -1, 0, 50, 0]
    poses = [message_type("geometry_msgs/msg/PoseStamped")() for _ in range(3)]
    made["nav_msgs/msg/Path"].poses = poses
    joints = made["sensor_msgs/msg/JointState"]
    joints.name, joints.position = ["left", "right"], [0.5, 1.0]
    made["sensor_msgs/msg/LaserScan"].ranges = [1.0, 2.0, 3.0]
    transform = message_type("geometry_msgs/msg/TransformStamped")()
    transform.header.frame_id, transform.child_frame_id = "map", "odom"
    made["tf2_msgs/msg/TFMessage"].transforms = [transform]
    return made


def _use(data, name):
    """Decode a message, encode it again, and use it."""
    message = decode(data, name)
    encode(message)
    if name.endswith("OccupancyGrid"):
        grid_of(message)
    if name.endswith("Odometry"):
        pose_of(message.pose.pose)
        twist_of(message.twist.twist)
