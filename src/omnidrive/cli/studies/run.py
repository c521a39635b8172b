"""``omnidrive run``: simulate one controller in one task."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.cli.components import RUN_TASKS, ControllerOption, one_run
from omnidrive.cli.faults import FaultOption, with_faults
from omnidrive.cli.options import (
    RESULTS_PANEL,
    RUN_PANEL,
    FiguresOption,
    FolderOption,
    ForceOption,
    FullOption,
    ResultsJsonOption,
    choice,
    default_folder,
    figure_formats,
    flag,
    option,
)
from omnidrive.cli.robots.robot import check_robot_file
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.cli.terminal import conclude
from omnidrive.errors import InvalidInput

_HorizonOption = Annotated[
    int | None, option("N", "Prediction horizon of the NMPC, in steps.", RUN_PANEL)
]
_SaveRobotOption = Annotated[
    Path | None,
    option(
        "FILE.yaml",
        "Robot file with the drive that the controller identified, as holonomic-nmpc does.",
        RESULTS_PANEL,
        "--save-robot",
    ),
]
_ViewOption = Annotated[
    bool, flag("Show the run in the MuJoCo viewer in real time.", RUN_PANEL, "--view")
]
_VideoOption = Annotated[
    Path | None, option("FILE", "Video of the run in real time: .mp4 or .gif.", RESULTS_PANEL)
]


@with_options()
def run(
    shared: ScenarioOptions,
    controller: ControllerOption = "holonomic-nmpc",
    task: Annotated[str, choice(RUN_TASKS, "Task.", RUN_PANEL)] = "track",
    horizon: _HorizonOption = None,
    fault: FaultOption = None,
    view: _ViewOption = False,
    out: FolderOption = None,
    figures: FiguresOption = None,
    video: _VideoOption = None,
    save_robot: _SaveRobotOption = None,
    force: ForceOption = False,
    json: ResultsJsonOption = False,
    full: FullOption = False,
) -> None:
    """Simulate one controller in one task; write metrics, time series, figures and report.

    The exit status is 1 if the run stops before its end.

    For example:

    * `omnidrive run --controller unicycle-nmpc --horizon 25`
    * `omnidrive run --controller mine.py:MyController,gain=2`
    * `omnidrive run --task noise --controller fuzzy_t2 --seed 7 --estimator`
    * `omnidrive run --fault wheel-dead:wheel=2,at=5`
    * `omnidrive run --video run.gif`
    * `omnidrive run --controller holonomic-nmpc --save-robot identified.yaml`
    """
    from omnidrive.cli.progress import LiveProgress, save_film
    from omnidrive.cli.studies.results import print_results
    from omnidrive.visualization import Observer, Recorder, Viewer, check_film

    if out is not None:
        study.check_new_folder(out)
    formats = figure_formats(figures)
    if video is not None:
        check_film(video)
    if save_robot is not None:
        check_robot_file(save_robot, force=force)
    scenario = one_run(shared.resolve(), controller, task, horizon, allow_code=shared.allow_code)
    resolved = with_faults(scenario, fault)
    (label,) = resolved.controllers
    folder = out or default_folder(f"{resolved.name}-{label}-{task}")
    with ExitStack() as stack:
        viewers = [stack.enter_context(Viewer())] if view else []
        recorders = [Recorder()] if video is not None else []
        progress = stack.enter_context(LiveProgress())
        observers: list[Observer] = [*viewers, *recorders]
        done = study.run_study(
            resolved,
            folder,
            progress=progress,
            observers=observers,
            numbered=out is None,
            figures=formats,
        )
        videos = [save_film(each.recording, video, progress) for each in recorders if video]
    print_results(done, json=json, full=full, lines=[f"video: {each}" for each in videos])
    if save_robot is not None:
        conclude(_save_drive(done, resolved, save_robot), beside_json=json)


def _save_drive(done: study.Study, scenario: scenarios.Scenario, file: Path) -> str:
    """Write the robot with the drive that the last run identified; return a line about it.

    Raises:
        InvalidInput: The run identified none.
    """
    from omnidrive.estimation.drive_estimate import identified_robot, logged_drive
    from omnidrive.robot import save_robot
    from omnidrive.scenario.sections import robot_of

    assert done.logs is not None
    result = done.logs.runs[-1]
    found = logged_drive(result.log.details)
    if found is None:
        raise InvalidInput(
            f"{result.controller} identifies no drive, so that there is no robot to save; use "
            "--controller holonomic-nmpc"
        )
    names = ("x", "y", "yaw", "lag")
    kept = [name for name, excited in zip(names, found.excited, strict=True) if not excited]
    notes = [f"Drive identified by {result.controller} in the run {done.folder}."]
    if kept:
        notes.append(f"Not determined by the motion, and not changed: {', '.join(kept)}.")
    save_robot(identified_robot(robot_of(scenario.robot), found), file, notes=notes)
    lacking = f"; the motion did not determine {', '.join(kept)}" if kept else ""
    return f"robot: {file}{lacking}"
