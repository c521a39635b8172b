"""Identification of the named robots from logs of the planar plant, with three levels of noise.

The plant integrates in steps of 0.1 ms, so that its lags are those of the servos.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from figures import at_least, publish, row
from rich.console import Console
from rich.table import Table

from omnidrive.robot import ROBOTS, Robot
from omnidrive.simulation import PlanarPlant
from omnidrive.simulation.identification import (
    identification_commands,
    identify_robot,
    simulated_log,
)
from omnidrive.simulation.planar.model import servo_lags

NOISES = {
    "low": (0.0005, 0.0005, 0.02),
    "middle": (0.003, 0.003, 0.1),
    "high": (0.01, 0.01, 0.3),
}  # m, rad, rad/s
SEEDS = 3
SAMPLE, DURATION = 0.01, 80.0  # s
DELAY = 5  # half samples
TIMESTEP = 1e-4  # s

console = Console(width=120)


def rows() -> Iterator[dict[str, object]]:
    """Yield share of parameters within three standard errors, and errors and standard errors."""
    table = Table("robot", "noise", "parameter", "mean error", "mean standard error", "truth",
                  "within 3")  # fmt: skip
    within: list[bool] = []
    missing = 0
    for robot in ROBOTS.values():
        truth = true_parameters(robot)
        for level, noise in NOISES.items():
            found = [estimates(robot, noise, seed) for seed in range(SEEDS)]
            for name, true in truth.items():
                known = [run[name] for run in found if not run[name].reason]
                missing += len(found) - len(known)
                if not known:
                    continue
                errors = np.array([each.value - true for each in known])
                sigmas = np.array([each.sigma for each in known])
                inside = np.abs(errors) <= 3.0 * sigmas
                within += inside.tolist()
                table.add_row(robot.name, level, name, f"{errors.mean():.2g}",
                              f"{sigmas.mean():.2g}", f"{true:.4g}",
                              f"{inside.sum()} of {len(known)}")  # fmt: skip
                title = f"{robot.name}, noise {level}: {name}"
                yield row(f"{title}, relative error", float(np.abs(errors).mean() / true), "1")
                yield row(f"{title}, relative standard error", float(sigmas.mean() / true), "1")
    console.print(table)
    yield row("parameters that were not identifiable", missing, "1")
    yield row("identified parameters", len(within), "1")
    share = 100.0 * float(np.mean(within))
    yield at_least("parameters within three standard errors", share, "%", 95.0)


def true_parameters(robot: Robot) -> dict[str, float]:
    translation, rotation = servo_lags(robot)
    return {
        "wheel radius": robot.wheel.radius,
        "effective radius": robot.effective_radius,
        "lag in translation": translation,
        "lag in rotation": rotation,
        "delay": 0.5 * SAMPLE * DELAY,
        "friction": robot.friction,
    }


def estimates(robot: Robot, noise: tuple[float, float, float], seed: int):
    rng = np.random.default_rng(seed)
    commands = identification_commands(robot, rng, SAMPLE, DURATION)
    plant = PlanarPlant(robot, timestep=TIMESTEP)
    log = simulated_log(plant, commands, SAMPLE, rng, pose_noise=noise[:2], wheel_noise=noise[2],
                        delay=DELAY)  # fmt: skip
    return identify_robot(log, robot).estimates


if __name__ == "__main__":
    publish("identify", list(rows()), printed=3)
