"""``omnidrive drive``: drive a robot in real time."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.cli.completion import component
from omnidrive.cli.components import ControllerOption, chosen_component, one_run
from omnidrive.cli.drives.drive_errors import tracking_error
from omnidrive.cli.options import (
    FiguresOption,
    FolderOption,
    default_folder,
    figure_formats,
    flag,
    option,
)
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.cli.terminal import conclude, notes_in_a_thread, show, warn
from omnidrive.errors import OmnidriveError, RunFailed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from omnidrive.components import Configured
    from omnidrive.deploy.controls import DriveControls
    from omnidrive.deploy.drive import DriveResult
    from omnidrive.deploy.robot_link import RobotLink

_PANEL = "Robot"
_PROMPT = "press a and Enter to arm the robot, Enter to stop it"
_POLL = 0.05
"""Time between two looks at the state of the drive, s."""


@with_options()
def drive(
    shared: ScenarioOptions,
    controller: ControllerOption = "holonomic-nmpc",
    link: Annotated[
        str,
        option(
            "NAME[,KEY=VALUE...]",
            "Connection to the robot: simulated, a robot in a process of its own; wheels, a motor "
            "board; lekiwi; replay, a log; or your own as FILE.py:NAME (`omnidrive list links`).",
            _PANEL,
            complete=component("links"),
        ),
    ] = "simulated",
    arm: Annotated[bool, flag("Arm the robot at once.", _PANEL, "--arm")] = False,
    cpu: Annotated[
        int | None, option("N", "Processor of the loop [default: any].", _PANEL, minimum=0)
    ] = None,
    rate: Annotated[
        float | None,
        option("HZ", "Samples per second, 1 to 1000 [default: those of the scenario].", _PANEL),
    ] = None,
    out: FolderOption = None,
    figures: FiguresOption = None,
) -> None:
    """Drive a robot in real time: a simulated one, or a real one over a link.

    The pipeline is that of `omnidrive run`, at the sample time of the scenario. Keys: `a` and Enter
    arms the robot, also after it was held; Enter alone, or Ctrl-C, stops it. Log, time series,
    figures and report are written to a run folder. The exit status is 1 if the robot does not reach
    the end of the reference, and 130 after Ctrl-C.

    For example:

    * `omnidrive drive --reference eight --link simulated,latency=0.02,jitter=0.005 --arm`
    * `omnidrive drive --reference circle --robot lekiwi --estimator --link lekiwi,host=10.0.0.5`
    """
    from omnidrive.deploy.controls import DriveControls
    from omnidrive.deploy.drive_folder import save_drive

    if out is not None:
        study.check_new_folder(out)
    formats = figure_formats(figures)
    chosen = chosen_component("links", link)
    given = one_run(shared.resolve(), controller, "track", None, allow_code=shared.allow_code)
    scenario = _with_rate(given, rate)
    planned = scenarios.plan_and_check(scenario)
    (label,) = scenario.controllers
    folder = study.RunFolder(
        out or default_folder(f"{scenario.name}-{label}-drive"), numbered=out is None
    )
    controls = DriveControls(arm=arm)
    with _keys(controls, armed=arm), _emptied_unless_begun(folder, remove=out is None):
        planned, result = _drive(planned, controls, chosen, folder, cpu=cpu)
    _print(result)
    if result.ran:
        report = save_drive(result, planned, chosen.type, folder, formats)
        conclude(f"results: {folder.path} (open {report})")
    else:
        conclude(f"nothing was driven; inputs and log: {folder.path}")
    _conclude(controls, result)


def _conclude(controls: DriveControls, result: DriveResult) -> None:
    """Exit with the status of the signal that ended a drive, or raise RunFailed if it failed."""
    if controls.interrupted:
        signal.raise_signal(controls.interrupted)
    if not result.finished:
        raise RunFailed(f"the robot stopped early: {result.ending}")


def _with_rate(scenario: scenarios.Scenario, rate: float | None) -> scenarios.Scenario:
    """Return the scenario with the sample time of a rate, Hz; None: its own."""
    from omnidrive.deploy.drive import RATES
    from omnidrive.parameter import check_number

    if rate is None:
        return scenario
    check_number("rate", rate, RATES)
    return scenario.model_copy(update={"sample_time": 1.0 / rate})


def _drive(
    planned: scenarios.PlannedScenario,
    controls: DriveControls,
    chosen: Configured,
    folder: study.RunFolder,
    *,
    cpu: int | None,
) -> tuple[scenarios.PlannedScenario, DriveResult]:
    """Drive the robot of a scenario over a link; return the scenario as driven, and the result."""
    from omnidrive.deploy.drive import drive as drive_robot
    from omnidrive.deploy.links.components import LinkContext, SimulatedParameters
    from omnidrive.deploy.log import RUN_LOG, DriveLog
    from omnidrive.deploy.robot_link import ReportingLink
    from omnidrive.deploy.scenario_files import attached_inputs
    from omnidrive.deploy.scenario_robot import (
        component_names,
        scenario_pipeline,
        with_paper_noise,
        without_pose_fixes,
    )

    if isinstance(chosen.parameters, SimulatedParameters) and chosen.parameters.noise:
        planned = with_paper_noise(planned)
    reference = planned.reference(study.planned_duration(planned))
    start = reference.at(0.0).pose
    link: RobotLink = chosen.make(LinkContext(planned, start))
    if not link.capabilities.measures_pose:
        planned = without_pose_fixes(planned)
    folder.save_inputs(planned)
    (label,) = planned.scenario.controllers
    log = None
    if find_spec("mcap") is None:
        show("no log: it needs the package mcap: pip install mcap")
    else:
        names = {"link": chosen.type, **component_names(planned, label)}
        log = DriveLog(folder.path / RUN_LOG, attached_inputs(folder), names=names)
    result = drive_robot(
        link,
        scenario_pipeline(planned, label),
        reference,
        rate=1.0 / planned.scenario.sample_time,
        start=start,
        controls=controls,
        cpu=cpu,
        log=log,
    )
    if isinstance(link, ReportingLink):
        show(link.report)
    return planned, result


@contextmanager
def _emptied_unless_begun(folder: study.RunFolder, *, remove: bool) -> Iterator[None]:
    """Empty a new run folder if the drive does not begin, so that the command can be repeated.

    Args:
        folder: The run folder, which holds nothing but the inputs before the drive begins.
        remove: Whether to remove the folder, too.
    """
    from omnidrive.deploy.log import RUN_LOG

    try:
        yield
    except OmnidriveError:
        if not (folder.path / RUN_LOG).exists():
            with suppress(OSError):
                for each in folder.path.iterdir():
                    each.unlink()
                if remove:
                    folder.path.rmdir()
        raise


@contextmanager
def _keys(controls: DriveControls, *, armed: bool) -> Iterator[None]:
    """Arm and stop with keys within the context, if the input is a terminal or a pipe."""
    keys, input_ends = not armed or os.isatty(0), threading.Event()
    prompt = "press Enter to stop the robot" if armed else _PROMPT
    if not keys:
        prompt = "the input is no terminal: a hold ends the drive, and so does Ctrl-C"
        input_ends.set()

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
        input_ends.set()

    if keys:
        threading.Thread(target=listen, daemon=True).start()
    with notes_in_a_thread(), _shown_states(controls, prompt, input_ends):
        yield


@contextmanager
def _shown_states(
    controls: DriveControls, prompt: str, input_ends: threading.Event
) -> Iterator[None]:
    """Print within the context what a user can do, and when the controller begins to drive.

    Args:
        controls: The controls of the drive.
        prompt: What is printed when the robot is connected.
        input_ends: Set when no key can arm the robot any more; a hold ends the drive then.
    """
    ended, shown = threading.Event(), ""
    waits = "held: press a and Enter to arm the robot again, Enter to stop it"
    ends = "held: the drive ends, because without a terminal the robot cannot be armed again"

    def watch() -> None:
        """Print each change until the context ends; the loop does not wait for the terminal."""
        nonlocal shown
        asked = False
        while not ended.wait(_POLL):
            if controls.connected and not asked:
                show(prompt)
                asked = True
            text = "the controller drives the robot" if controls.tracked is not None else ""
            held, alone = controls.held, input_ends.is_set()
            if held is not None:
                text = ends if alone else waits
                if alone:
                    controls.stop(f"held without a terminal: {held}")
            if text and text != shown:
                show(text)
            shown = text

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(1.0)  # the terminal may have stopped the output


def _print(result: DriveResult) -> None:
    """Print what happened, and how punctual the loop was."""
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
        show(tracking_error(result.run))
    if result.log is not None and (result.log.dropped or result.log.failure):
        lost = f"{result.log.dropped} samples dropped"
        warn(f"the log is not whole: {'; '.join(filter(None, [lost, result.log.failure]))}")
    if result.limited:
        show(f"{result.limited} commands scaled down to the limits of the robot")
