"""Processor time of the state estimator and of the lidar, after compilation.

The robot `paper` rolls without slip; its estimator receives wheel angles, the yaw rate and a pose
fix ten times a second. A late fix is inserted at its stamp, and all later readings are processed
again. filterpy, if it is installed, does one prediction and one correction of a filter of the same
size, without late fixes.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import process_time_ns

import mujoco
import numpy as np
from figures import at_most, publish, row

from omnidrive.estimation import PoseEstimator, PoseFixSettings, SensorSettings
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import named_robot
from omnidrive.simulation import Lidar, LidarSettings, PlantState, SensorSuite

STEPS, DT = 3000, 0.1
START, TWIST = Pose(0.0, 0.0, 0.0), BodyTwist(0.4, 0.1, 0.3)
LATENCIES = (0.0, 0.1, 0.5)  # s
RAYS = 360
ROOM = """<mujoco><worldbody>
  <geom type="plane" size="9 9 1"/>
  <geom type="box" size="0.1 9 1" pos="5 0 1"/> <geom type="box" size="0.1 9 1" pos="-5 0 1"/>
  <geom type="box" size="9 0.1 1" pos="0 5 1"/> <geom type="box" size="9 0.1 1" pos="0 -5 1"/>
  {boxes}
  <body name="base"><freejoint/><geom type="cylinder" size="0.3 0.1"/></body>
</worldbody></mujoco>"""


def per_call(calls: list[Callable[[], object]]) -> float:
    """Return the median time of the calls, us; each call is done once."""
    times = []
    for call in calls:
        start = process_time_ns()
        call()
        times.append((process_time_ns() - start) * 1e-3)
    return median(times)


def update_time(latency: float) -> float:
    """Return the time of one update of the estimator, us, for fixes with ``latency`` (s)."""
    robot = named_robot("paper")
    settings = SensorSettings(fixes=PoseFixSettings(latency=latency))
    sensors = SensorSuite(settings, robot.chassis, np.random.default_rng(0))
    estimator = PoseEstimator(robot, settings)
    sensors.reset(START)
    estimator.reset(START)
    poses = [move(START, TWIST, DT * k) for k in range(STEPS)]
    wheels = robot.chassis.wheel_speeds(TWIST)
    states = [
        PlantState(pose, TWIST, 0.0, tuple((wheels * DT * k).tolist()))
        for k, pose in enumerate(poses)
    ]
    readings = [sensors.read(DT * k, state) for k, state in enumerate(states)]
    return per_call([lambda r=r: estimator.update(r) for r in readings])


def filterpy_time() -> float | None:
    """Return the time of filterpy's prediction and correction with 3 of 10 states measured, us.

    None if filterpy is not installed.
    """
    try:
        from filterpy.kalman import ExtendedKalmanFilter
    except ImportError:
        return None
    peer = ExtendedKalmanFilter(10, 3)
    peer.x = np.zeros(10)
    peer.Q, observation = 1e-4 * np.eye(10), np.eye(3, 10)

    def step() -> None:
        peer.predict()
        peer.update(np.zeros(3), lambda x: observation, lambda x: x[:3])

    return per_call([step] * STEPS)


def scan_time(boxes: int) -> float:
    """Return the time of one scan among ``boxes`` boxes, us."""
    rng = np.random.default_rng(0)
    obstacles = "".join(
        f'<geom type="box" size="0.1 0.1 1" pos="{x:.3f} {y:.3f} 1"/>'
        for x, y in rng.uniform(-4.5, 4.5, (boxes, 2))
    )
    model = mujoco.MjModel.from_xml_string(ROOM.format(boxes=obstacles))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lidar = Lidar(LidarSettings(rays=RAYS), model, data, rng)
    return per_call([lambda: lidar.scan(0.0)] * 300)


def main() -> None:
    update_time(0.1)  # compilation
    rows = [
        at_most(f"update, fixes {s:g} s late", update_time(s), "us", 100.0) for s in LATENCIES[:2]
    ]
    rows.append(row(f"update, fixes {LATENCIES[2]:g} s late", update_time(LATENCIES[2]), "us"))
    peer = filterpy_time()
    if peer is not None:
        rows.append(row("filterpy, prediction and correction", peer, "us"))
    rows += [row(f"scan of {RAYS} rays, {n} boxes", scan_time(n), "us") for n in (0, 100, 1000)]
    publish("estimation", rows)


if __name__ == "__main__":
    main()
