"""``omnidrive drive``: drive a robot in real time."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from omnidrive import study
from omnidrive.cli.components import ControllerOption, with_controllers
from omnidrive.cli.options import RESULTS_PANEL, flag, option
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.cli.terminal import conclude, show
from omnidrive.errors import RunFailed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from omnidrive.deploy.controls import DriveControls
    from omnidrive.deploy.drive import DriveResult

_PANEL = "Robot"
_MillisecondsOption = Annotated[float, option("MS", "Delay of readings and commands, ms.", _PANEL)]


@with_options()
def drive(
    shared: ScenarioOptions,
    controller: ControllerOption = "holonomic-nmpc",
    latency: _MillisecondsOption = 0.0,
    jitter: Annotated[float, option("MS", "Largest random delay in addition, ms.", _PANEL)] = 0.0,
    noise: Annotated[bool, flag("Noise of the paper on the poses.", _PANEL, "--noise")] = False,
    arm: Annotated[bool, flag("Arm the robot at once.", _PANEL, "--arm")] = False,
    cpu: Annotated[
        int | None, option("N", "Processor of the loop [default: any].", _PANEL, least=0)
    ] = None,
    log: Annotated[
        Path | None, option("FILE", "Log: .mcap, .parquet or .csv.", RESULTS_PANEL)
    ] = None,
) -> None:
    """Drive a robot in real time: a simulated one in a process of its own.

    The pipeline is that of `omnidrive run`, at the sample time of the scenario. Keys: `a` and Enter
    arms the robot, also after it was held; Enter alone, or Ctrl-C, stops it. The exit status is 1
    if the robot does not reach the end of the reference.

    For example:

    * `omnidrive drive --reference circle,radius=1 --plant planar --estimator --arm`
    * `omnidrive drive --reference eight --controller feedforward --latency 20 --jitter 5 --arm`
    """
    from omnidrive.deploy.controls import DriveControls
    from omnidrive.simulation.log_file import check_log_file, save_log

    if log is not None:
        check_log_file(log)
    planned = study.plan_and_check(with_controllers(shared.resolve(), [controller]))
    controls = DriveControls(arm=arm)
    with _keys(controls, armed=arm):
        result = _drive(planned, controls, latency, jitter, noise=noise, cpu=cpu)
    if log is not None:
        save_log(result.run.columns, result.run.events, log)
        conclude(f"log: {log}")
    _print(result)
    if not result.finished:
        raise RunFailed(f"the robot stopped early: {result.ending}")


def _drive(
    planned: study.PlannedScenario,
    controls: DriveControls,
    latency: float,
    jitter: float,
    *,
    noise: bool,
    cpu: int | None,
) -> DriveResult:
    """Drive the simulated robot of a scenario; ``latency`` and ``jitter`` in ms."""
    from omnidrive.deploy.drive import drive as drive_robot
    from omnidrive.deploy.links.simulated import SimulatedProcess
    from omnidrive.deploy.scenario_robot import ScenarioRobot, scenario_pipeline

    scenario = planned.scenario
    (label,) = scenario.controllers
    reference = planned.reference(study.planned_duration(planned))
    start = reference.at(0.0).pose
    link = SimulatedProcess(
        planned.plant_robot,
        ScenarioRobot(planned, noise),
        start,
        scenario.sample_time,
        1e-3 * latency,
        1e-3 * jitter,
        scenario.seed,
    )
    return drive_robot(
        link,
        scenario_pipeline(planned, label),
        reference,
        rate=1.0 / scenario.sample_time,
        start=start,
        controls=controls,
        cpu=cpu,
    )


@contextmanager
def _keys(controls: DriveControls, *, armed: bool) -> Iterator[None]:
    """Arm and stop with keys within the context, if the input is a terminal or a pipe."""
    if not armed:
        show("press a and Enter to arm the robot, Enter to stop it")

    def listen() -> None:
        """Read lines until one stops the robot."""
        for line in sys.stdin:
            if line.strip() == "a":
                controls.arm()
            else:
                controls.stop("stopped by the user")
                return
        if not armed and not controls.arm_requested:
            controls.stop("the input ended")

    if not armed or os.isatty(0):
        threading.Thread(target=listen, daemon=True).start()
    yield


def _print(result: DriveResult) -> None:
    """Print what happened, and how punctual the loop was."""
    from omnidrive.evaluation.metrics import position_error

    for change in result.changes:
        show(f"{change.t:8.3f} s  {change.state.value:<8} {change.reason}")
    timing = result.timing.summary()
    show(f"samples {timing.samples}, missed {timing.misses} ({100.0 * timing.miss_share:.2g} %)")
    show(
        f"jitter {1e6 * timing.jitter_median:.0f} us (median), {1e6 * timing.jitter_p99:.0f} us "
        f"(p99), {1e6 * timing.jitter_max:.0f} us (largest)"
    )
    show(
        f"until the command is sent {1e3 * timing.busy_median:.2f} ms (median), "
        f"{1e3 * timing.busy_p99:.2f} ms (p99)"
    )
    show(result.timing.histogram())
    for measure in result.measures:
        show(str(measure))
    if len(result.run.t) > 1:
        error = position_error(result.run.pose, result.run.target)
        show(
            f"estimated tracking error: ME {1e3 * error.mean():.2f} mm over {result.run.t[-1]:g} s"
        )
    if result.limited:
        show(f"{result.limited} commands scaled down to the limits of the robot")
