"""Verb `omnidrive ros2 drive`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive.cli.completion import component
from omnidrive.cli.drives.drive_errors import tracking_error
from omnidrive.cli.drives.ros2_node import (
    DistributionOption,
    DomainOption,
    PeersOption,
    node_options,
)
from omnidrive.cli.options import RESULTS_PANEL, default_folder, flag, option
from omnidrive.cli.terminal import conclude, note, notes_in_a_thread, show
from omnidrive.errors import InvalidInput, MissingExtra, one_line

if TYPE_CHECKING:
    from omnidrive.deploy.drive import DriveResult
    from omnidrive.deploy.log import LogFolder
    from omnidrive.deploy.ros2.drive_settings import DriveSettings
    from omnidrive.geometry import Pose
    from omnidrive.reference import Reference
    from omnidrive.robot import Robot

_LOG_BYTES = 1e9  # from which another file is begun
_ReferenceOption = Annotated[
    str | None,
    option(
        "NAME[,KEY=VALUE...]|FILE",
        "Drive this motion once: a waypoint file, or a shape from the robot's pose on, such as "
        "circle or eight [default: follow /plan and /goal_pose].",
        complete=component("references"),
    ),
]
_ParamsOption = Annotated[
    Path | None, option("FILE.yaml", "Parameters, in the form of ROS 2 parameter files.")
]
_RobotOption = Annotated[
    str | None, option("NAME|FILE", "Robot, or a robot file.", None, complete=component("robots"))
]
_InitialPoseOption = Annotated[
    str | None,
    option("X,Y[,HEADING]", "Pose from which laser scans localise the robot, m, m, rad."),
]
_PublishersOption = Annotated[
    list[str] | None,
    option(
        "NODE",
        "Node that may send commands besides the drive (repeatable); a command of another node "
        "ends the drive.",
        None,
        "--allow-publisher",
    ),
]
_LogsOption = Annotated[
    Path | None,
    option(
        "FOLDER",
        "New folder of the logs, one for each drive [default: runs/ros2-drive-TIME].",
        RESULTS_PANEL,
        "--out",
    ),
]
_NoLogOption = Annotated[bool, flag("Write no logs.", RESULTS_PANEL, "--no-log")]
_CodeOption = Annotated[
    bool,
    flag(
        "Import code that the parameter file names, such as mine.py:MyController; only for files "
        "that you trust.",
        None,
        "--allow-code",
    ),
]
_ServeOption = Annotated[
    bool,
    flag(
        "Serve the action follow_path and the lifecycle of the node, as the controller server of "
        "Nav2; other nodes need rmw_cyclonedds.",
        None,
        "--serve",
    ),
]


def drive(
    reference: _ReferenceOption = None,
    params: _ParamsOption = None,
    robot: _RobotOption = None,
    controller: Annotated[
        str | None,
        option("NAME[,KEY=VALUE...]", "Controller.", None, complete=component("controllers")),
    ] = None,
    rate: Annotated[float | None, option("HZ", "Rate of the loop, Hz.")] = None,
    max_speed: Annotated[float | None, option("M/S", "Largest speed of the motion, m/s.")] = None,
    world_frame: Annotated[str | None, option("NAME", "Frame of paths and goals.")] = None,
    base_frame: Annotated[str | None, option("NAME", "Frame of the robot.")] = None,
    cmd_vel: Annotated[str | None, option("TOPIC", "Topic of commands.")] = None,
    allow_publisher: _PublishersOption = None,
    odom: Annotated[str | None, option("TOPIC", "Topic of odometry.")] = None,
    plan: Annotated[str | None, option("TOPIC", "Topic of paths.")] = None,
    initial_pose: _InitialPoseOption = None,
    use_sim_time: Annotated[
        bool | None, flag("Use the time of /clock.", None, "--use-sim-time")
    ] = None,
    serve: _ServeOption = False,
    node_name: Annotated[str, option("NAME", "Name of the node.")] = "omnidrive_drive",
    drives: Annotated[
        int | None, option("N", "Number of paths and goals [default: until stopped].", minimum=1)
    ] = None,
    out: _LogsOption = None,
    no_log: _NoLogOption = False,
    allow_code: _CodeOption = False,
    domain: DomainOption = None,
    peers: PeersOption = None,
    distribution: DistributionOption = None,
) -> None:
    """Drive a robot in a ROS 2 graph with a controller of omnidrive.

    The pose comes from /tf, /odom and /amcl_pose, or from /scan on /map; commands go to /cmd_vel
    with the type that the robot has. It publishes /diagnostics, local_plan and markers. True on
    /e_stop ends the drive; after a hold, true on /omnidrive_drive/arm lets it go on.

    For example:

    * `omnidrive ros2 drive --robot mecanum --reference eight`
    * `omnidrive ros2 drive --params drive.yaml --plan /plan_smoothed`
    * `omnidrive ros2 drive --serve --node-name controller_server`
    """
    options = node_options(domain, peers, distribution)
    settings = _drive_settings(
        params, node_name, allow_code,
        robot=robot, controller=controller, rate=rate, max_speed=max_speed,
        world_frame=world_frame, base_frame=base_frame, cmd_vel=cmd_vel, odom=odom, plan=plan,
        initial_pose=initial_pose, use_sim_time=use_sim_time,
        allowed_publishers=allow_publisher or None,
    )  # fmt: skip
    if serve and reference is not None:
        raise InvalidInput("--serve follows the paths of its goals: leave out --reference")
    if out is not None and no_log:
        raise InvalidInput("--out and --no-log exclude each other: leave out one")
    logs = None if no_log else _logs(out, settings)
    if not _drive(settings, options, node_name, reference, logs, serve=serve, drives=drives):
        raise typer.Exit(1)


def _drive_settings(
    params: Path | None, node: str, allow_code: bool, **options: Any
) -> DriveSettings:
    """Return the settings of a file, if there is one, with the options."""
    from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters

    settings = DriveSettings()
    if params is not None:
        settings = settings.with_values(read_parameters(params, node), f"{one_line(str(params))}: ")
    settings = settings.with_values(options)
    named = options["controller"] is not None  # by the user
    try:
        settings.import_controller(allow_code=allow_code or named)
    except InvalidInput as error:
        place = "" if params is None or named else f"{one_line(str(params))}: "
        raise InvalidInput(f"{place}{error}") from None
    return settings


def _logs(folder: Path | None, settings: DriveSettings) -> LogFolder | None:
    """Return the folder of the logs, which is created; None: the package mcap is missing."""
    from omnidrive.deploy.log import LogFolder
    from omnidrive.deploy.log.log_file import mcap_module
    from omnidrive.deploy.ros2.drive_files import PARAMETERS_FILE, parameters_file
    from omnidrive.files.output_file import create_folder
    from omnidrive.study import check_new_folder

    try:
        mcap_module("writer")
    except MissingExtra as error:
        if folder is not None:
            raise
        note(str(error))
        return None
    if folder is not None:
        check_new_folder(folder)
    made = folder or default_folder("ros2-drive")
    create_folder(made)
    names = {"link": "ros2", "controller": settings.controller_name, "estimator": "none"}
    return LogFolder(made, {PARAMETERS_FILE: parameters_file(settings)}, _LOG_BYTES, names)


def _drive(
    settings: DriveSettings,
    options: dict[str, Any],
    name: str,
    reference: str | None,
    logs: LogFolder | None,
    *,
    serve: bool,
    drives: int | None,
) -> bool:
    """Drive, print the end of each drive, and return whether all were finished."""
    from omnidrive.compiled import announce_compiling
    from omnidrive.deploy.ros2.drive_reports import DriveReports
    from omnidrive.deploy.ros2.follow_path import FollowPathServer
    from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
    from omnidrive.deploy.ros2.plan_follower import PlanFollower
    from omnidrive.deploy.ros2.ros2_link import Ros2Link
    from omnidrive.ros2 import Node

    made = settings.make_robot()
    with Node(name, **options) as node, announce_compiling(), notes_in_a_thread():
        link = Ros2Link(node, made, settings.link)
        reports = DriveReports(node, link.ros_clock, settings.world_frame)
        pipeline = settings.make_pipeline(made, reports)
        follower = PathFollower(
            link,
            pipeline,
            settings.rate,
            DriveRequests(node, settings.stop),
            speed=settings.max_speed,
            margin=settings.margin,
            logs=logs,
            reports=reports,
        )
        if reference is not None:
            motion = _motion(reference, made, follower.current_pose(), settings.max_speed)
            return _conclude(follower.drive(motion))
        if serve:
            show(f"serving follow_path; the lifecycle of {node.full_name} is unconfigured")
            return all([_conclude(each) for each in FollowPathServer(follower).run(drives)])
        plans = PlanFollower(follower, settings.plan, settings.goal, settings.map)
        show(f"waiting for paths on {settings.plan} and goals on {settings.goal}")
        return all([_conclude(each) for each in plans.run(drives)])


def _motion(text: str, robot: Robot, start: Pose, max_speed: float | None) -> Reference:
    """Return the motion of an option: a waypoint file, or a shape from the robot's pose on."""
    from omnidrive.cli.components import chosen_component, reference_data
    from omnidrive.components import configure
    from omnidrive.reference import slowed_to
    from omnidrive.reference.components import ReferenceContext

    data = reference_data(text)
    if "file" in data:
        chosen = configure("references", data["type"], {"file": data["file"]})
    else:
        chosen = chosen_component("references", text)
    motion: Reference = chosen.make(ReferenceContext(robot, start, max_speed))
    return slowed_to(motion, max_speed)


def _conclude(result: DriveResult) -> bool:
    """Print the end of a drive; return whether it was finished."""
    timing = result.timing
    conclude(f"{result.ending}; {timing.misses} late samples, {result.limited} commands limited")
    if len(result.run.t) > 1:
        show(tracking_error(result.run))
    if result.log is not None:
        conclude(f"log: {result.log.paths[0]}")
    return result.finished
