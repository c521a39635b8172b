"""Wall time of the default study by part, and real-time factor of each plant."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from figures import at_most, publish, row

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import ROBOTS
from omnidrive.scenario import make_plant, paper_scenario
from omnidrive.study import run_study

ROUNDS = 5
SECONDS = 4.0  # simulated per round
STUDY_LIMIT = 90.0  # s on two cores, with compiled kernels
PLANTS = ("kinematic", "mujoco-balls", "mujoco-rollers")
TWIST = BodyTwist(0.5, 0.2, 0.6)


def study_rows() -> list[dict[str, object]]:
    """Return the wall time of the parts of `omnidrive compare` on two processes, after warm-up."""
    with TemporaryDirectory() as folder:
        run_study(paper_scenario(), Path(folder) / "warm", processes=2)
        began = perf_counter()
        study = run_study(paper_scenario(), Path(folder) / "timed", processes=2)
        total = perf_counter() - began
    rows = [row(f"study: {part}", seconds, "s") for part, seconds in study.timing.items()]
    return [*rows, at_most("study: total", total, "s", STUDY_LIMIT)]


def plant_rows() -> list[dict[str, object]]:
    """Return the median real-time factor of each plant on one core, over interleaved rounds."""
    pairs = [(robot, name) for robot in ROBOTS for name in PLANTS]
    plants = {pair: make_plant(ROBOTS[pair[0]], pair[1]) for pair in pairs}
    factors: dict[tuple[str, str], list[float]] = {pair: [] for pair in pairs}
    for _ in range(ROUNDS):
        for pair, plant in plants.items():
            plant.reset(Pose(0.0, 0.0, 0.0))
            began = perf_counter()
            for _ in range(round(SECONDS / 0.1)):
                plant.step(TWIST, 0.1)
            factors[pair].append(SECONDS / (perf_counter() - began))
    names = {pair: f"real-time factor: {pair[1]}, robot {pair[0]}" for pair in pairs}
    return [row(names[pair], median(factors[pair]), "1") for pair in pairs]


def main() -> None:
    publish("study", study_rows() + plant_rows())


if __name__ == "__main__":
    main()
