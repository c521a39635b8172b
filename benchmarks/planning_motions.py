"""Rows of the planning benchmark on Choreo and PathPlanner files.

The duration of `minimum_time_through` is compared with the last time in a Choreo file, for the
robot of the `.chor` file in the same folder. The limits are within Choreo's: polygons in the discs
of the modules' velocities, and the hull of net forces at the limit of the discs of the modules'
forces. The body is the largest disc around the origin inside the bumpers. Files whose samples
exceed the limits of the `.chor` file were generated for another robot and are left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from figures import at_most, console, row
from scipy.spatial import ConvexHull

from omnidrive.errors import OmnidriveError
from omnidrive.reference import (
    MotionLimits,
    MotionProblem,
    load_motion_problem,
    load_waypoints,
    minimum_time_through,
)
from omnidrive.robot import Chassis

SLOWER, SLACK = 1.02, 1.005  # of Choreo's duration; of its limits in its own samples
DIRECTIONS, LATITUDES, GRAVITY = 12, 4, 9.8  # m/s^2, as in Choreo
REST = 1e-3  # m/s


class Drive(NamedTuple):
    """Robot of a `.chor` file: module positions in m, kg, kg m^2, m/s, N, and body radius in m."""

    modules: np.ndarray
    mass: float
    inertia: float
    speed: float
    force: float
    body: float

    @classmethod
    def of(cls, file: Path) -> Drive:
        config = json.loads(file.read_text())["config"]
        names = ("mass", "inertia", "gearing", "radius", "vmax", "tmax", "cof")
        mass, inertia, gearing, radius, vmax, tmax, friction = (_value(config[n]) for n in names)
        front, back = (
            np.array([_value(config[name][axis]) for axis in "xy"])
            for name in ("frontLeft", "backLeft")
        )
        modules = np.array([front, back, back * (1, -1), front * (1, -1)])
        force = min(tmax * gearing / radius, friction * mass * GRAVITY / 4)
        body = min(_value(config["bumper"][name]) for name in ("front", "side", "back"))
        return cls(modules, mass, inertia, vmax / gearing * radius, force, body)

    def limits(self) -> tuple[Chassis, MotionLimits]:
        """Return the polygons and the hull of the limits."""
        angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
        along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        turning = np.stack([-self.modules[:, 1], self.modules[:, 0]], axis=1)
        rows = np.concatenate([np.column_stack([along, along @ each]) for each in turning])
        top = self.speed * np.cos(0.5 * np.pi / DIRECTIONS)
        return Chassis(rows, top), MotionLimits(acceleration_faces=self._faces(turning))

    def _faces(self, turning: np.ndarray) -> np.ndarray:
        size = float(np.linalg.norm(turning, axis=1).mean())
        directions = [(0.0, 0.0, 1.0)]
        for number, latitude in enumerate(np.linspace(0.0, np.pi / 2, LATITUDES)[:-1]):
            count = round(DIRECTIONS * np.cos(latitude))
            angles = 2.0 * np.pi * (np.arange(count) + 0.5 * (number % 2)) / count
            directions += [
                (np.cos(latitude) * np.cos(a), np.cos(latitude) * np.sin(a), np.sin(latitude))
                for a in angles
            ]
        both = np.vstack([directions, np.negative(directions)])
        net = np.zeros((len(both), 3))
        for each in turning / size:  # the force of each module that does most along a direction
            force = both[:, :2] + both[:, 2:] * each
            force /= np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-12)
            net += np.column_stack([force, force @ each])
        equations = ConvexHull(self.force * net).equations
        faces = np.unique(np.round(-equations[:, :3] / equations[:, 3:], 9), axis=0)
        kept: list[np.ndarray] = []
        for face in faces:
            if not any(np.allclose(face, -other, rtol=1e-4, atol=1e-9) for other in kept):
                kept.append(face)
        return np.array(kept) * (self.mass, self.mass, self.inertia / size)

    def use(self, samples: list[dict[str, Any]]) -> float:
        """Return the largest use of the limits by samples in a file."""
        largest = 0.0
        for each in samples:
            largest = max(largest, float(np.hypot(each["fx"], each["fy"]).max()) / self.force)
            c, s = np.cos(each["heading"]), np.sin(each["heading"])
            v = np.array([c * each["vx"] + s * each["vy"], c * each["vy"] - s * each["vx"]])
            wheels = v + each["omega"] * self.modules[:, ::-1] * (-1, 1)
            largest = max(largest, float(np.linalg.norm(wheels, axis=1).max()) / self.speed)
            if self.mass * abs(each["ax"]) > 0.1 * self.force:
                largest = max(largest, abs(sum(each["fx"]) / each["ax"] / self.mass))
        return largest


def motion_rows(folder: Path | None, count: int = 60) -> Iterator[dict[str, Any]]:
    """Yield rows on the files in a folder and below; none without a folder."""
    if folder is None:
        console.print("Motions through waypoints are skipped: no folder is given by --motions.")
        return
    files = sorted([*folder.rglob("*.traj"), *folder.rglob("*.path")])
    faults = [fault for file in files if (fault := _fault(file))]
    for fault in faults:
        console.print(fault, markup=False)
    yield row("files of Choreo and PathPlanner", len(files), "1")
    yield row("files that are refused", len(faults), "1")
    compared = [found for file in files if (found := _comparable(file)) is not None]
    np.random.default_rng(3).shuffle(compared)
    ratios, seconds, states = [], [], []
    for problem, drive, duration, file in compared[:count]:
        start = process_time()
        try:
            motion = minimum_time_through(
                problem.waypoints,
                *drive.limits(),
                problem.sections,
                body_radius=drive.body,
                guess=problem.guess,
            )
        except OmnidriveError as error:
            states.append("failed")
            console.print(f"{file.name}: {error}", markup=False)
            continue
        seconds.append(process_time() - start)
        states.append(motion.status)
        ratios.append(motion.reference.duration / duration)
        console.print(f"{file.name}: {ratios[-1]:.4f} of Choreo's time, {motion.status}")
    if not states:
        return
    for state in ("converged", "capped", "guess", "failed"):
        yield row(f"motions through waypoints: {state}", states.count(state), "1")
    yield row(
        "motions through waypoints: median time as a share of Choreo's", np.median(ratios), "1"
    )
    yield at_most("motions through waypoints: longest", max(ratios), "1", SLOWER)
    yield row("motions through waypoints: median processor time", np.median(seconds), "s")


def _fault(file: Path) -> str | None:
    try:
        load_motion_problem(file)
        load_waypoints(file)
    except OmnidriveError as error:
        return str(error)
    return None


def _comparable(file: Path) -> tuple[MotionProblem, Drive, float, Path] | None:
    """Return the problem that a Choreo file was generated for, the robot and its duration."""
    try:
        content = json.loads(file.read_text())
        samples = content["trajectory"]["samples"]
        drive = Drive.of(next(file.parent.glob("*.chor")))
        moving = max(abs(each[k]) for each in (samples[0], samples[-1]) for k in ("vx", "vy"))
        if moving > REST or drive.use(samples) > SLACK:
            return None
        content["params"] = content["snapshot"]
        with TemporaryDirectory() as folder:
            copy = Path(folder) / "a.traj"
            copy.write_text(json.dumps(content))
            return load_motion_problem(copy), drive, samples[-1]["t"], file
    except (OmnidriveError, StopIteration, LookupError, TypeError, ValueError):
        return None  # of another kind, or without a robot


def _value(field: Any) -> float:
    return float(field["val"] if isinstance(field, dict) else field)
