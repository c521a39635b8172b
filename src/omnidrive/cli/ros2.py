"""Command `omnidrive ros2`: drive or simulate a robot in a ROS 2 graph, and examine the graph."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive.cli.completion import component
from omnidrive.cli.options import JsonOption, choice, choose_one, flag, option, verb_group
from omnidrive.cli.terminal import conclude, print_json, show
from omnidrive.errors import InvalidInput, one_line

if TYPE_CHECKING:
    from omnidrive.deploy.drive import DriveResult
    from omnidrive.deploy.ros2.doctor import Examination, Finding
    from omnidrive.deploy.ros2.drive_settings import DriveSettings
    from omnidrive.deploy.ros2.simulated_robot import Ros2RobotSettings
    from omnidrive.geometry import Pose
    from omnidrive.reference import Reference
    from omnidrive.robot import Robot

ros2 = verb_group("Drive or simulate a robot in a ROS 2 graph, and examine the graph.")

_DISTRIBUTIONS = ("humble", "iron", "jazzy", "kilted")
_GRAPH_PANEL = "Graph"
DomainOption = Annotated[
    int | None, option("N", "Domain [default: ROS_DOMAIN_ID, or 0].", _GRAPH_PANEL, least=0)
]
PeersOption = Annotated[
    list[str] | None,
    option(
        "HOST",
        "Host of other nodes, asked by unicast (repeatable), such as localhost [default: all hosts "
        "of the network, by multicast].",
        _GRAPH_PANEL,
        "--peer",
    ),
]
DistributionOption = Annotated[
    str | None,
    choice(
        _DISTRIBUTIONS,
        "Distribution of the other nodes [default: ROS_DISTRO, or as they announce themselves].",
        _GRAPH_PANEL,
    ),
]

_RobotOption = Annotated[
    str, option("NAME|FILE", "Robot, or a robot file.", None, complete=component("robots"))
]
_PlantOption = Annotated[
    str,
    option(
        "NAME[,KEY=VALUE...]",
        "Plant: kinematic, planar, mujoco-balls, mujoco-rollers, or your own as FILE.py:NAME.",
        None,
        complete=component("plants"),
    ),
]
_MapOption = Annotated[
    str | None, option("FILE|NAME", "Map around the robot, with a laser scanner in it.")
]
_StartOption = Annotated[str, option("X,Y[,HEADING]", "Pose at the start, m, m, rad.")]
_CommandTypeOption = Annotated[
    str | None,
    choice(
        ("Twist", "TwistStamped"),
        "Type of /cmd_vel [default: Twist for Humble and Iron, otherwise TwistStamped].",
    ),
]


def node_options(domain: int | None, peers: list[str] | None, distribution: str | None) -> Any:
    """Return the arguments of a node, checked."""
    chosen = None
    if distribution is not None:
        chosen = choose_one("distribution", distribution, _DISTRIBUTIONS)
    return {"domain": domain, "peers": tuple(peers or ()), "distribution": chosen}


@ros2.command()
def doctor(
    domain: DomainOption = None,
    peers: PeersOption = None,
    distribution: DistributionOption = None,
    duration: Annotated[float, option("S", "Time of listening, s.", None)] = 3.0,
    json: JsonOption = False,
) -> None:
    """Show nodes and topics, and what prevents messages from arriving, with what to do.

    It finds a wrong domain, different types and definitions, incompatible QoS, several publishers
    of commands, differences between clocks, and stamps of another time. The exit status is 1 if it
    finds an error.

    For example:

    * `omnidrive ros2 doctor`
    * `omnidrive ros2 doctor --domain 5 --peer 192.168.0.20`
    """
    from omnidrive.deploy.ros2 import Node
    from omnidrive.deploy.ros2.doctor import diagnose, examine
    from omnidrive.parameter import Bounds, check_number

    check_number("--duration", duration, Bounds(0.1, 3600.0, "s"))
    options = node_options(domain, peers, distribution)
    with Node("omnidrive_doctor", **options) as node:
        seen = examine(node, duration, options["peers"])
    findings = diagnose(seen)
    if json:
        print_json(_record(seen, findings))
    else:
        _print(seen, findings)
    if any(each.level == "error" for each in findings):
        raise typer.Exit(1)


def _print(seen: Examination, findings: list[Finding]) -> None:
    graph = seen.graph
    show(f"domain {graph.domain}, {seen.distribution}, {seen.duration:g} s")
    for each in sorted({n for p in graph.participants if not p.local for n in p.nodes}):
        show(f"node   {one_line(each, 200)}")
    for topic, types in graph.topics().items():
        counts = f"{len(graph.publishers(topic))} -> {len(graph.subscriptions(topic))}"
        heard = seen.traffic.get(topic)
        rate = f", {heard.count / seen.duration:.3g} Hz" if heard else ""
        show(f"topic  {one_line(topic, 200)}  {', '.join(sorted(types))}  {counts}{rate}")
    for finding in findings:
        style = {"error": "red", "warning": "yellow", "note": "green"}[finding.level]
        show(f"{typer.style(f'{finding.level:<8}', fg=style)} {one_line(finding.fact, 500)}")
        if finding.remedy:
            show(f"         {finding.remedy}")


def _record(seen: Examination, findings: list[Finding]) -> dict[str, Any]:
    graph = seen.graph
    return {
        "domain": graph.domain,
        "distribution": seen.distribution,
        "nodes": sorted({n for p in graph.participants if not p.local for n in p.nodes}),
        "topics": {
            topic: {
                "types": sorted(types),
                "publishers": [each.node for each in graph.publishers(topic)],
                "subscriptions": [each.node for each in graph.subscriptions(topic)],
            }
            for topic, types in graph.topics().items()
        },
        "findings": [each._asdict() for each in findings],
    }


@ros2.command()
def simulate(
    robot: _RobotOption = "paper",
    plant: _PlantOption = "planar",
    map: _MapOption = None,
    start: _StartOption = "0,0,0",
    rate: Annotated[float, option("HZ", "Rate of odometry and transforms, Hz.")] = 50.0,
    speed: Annotated[float, option("X", "Simulated seconds per second.")] = 1.0,
    cmd_vel: _CommandTypeOption = None,
    clock: Annotated[
        bool, flag("Publish /clock; all stamps are simulated times.", None, "--clock")
    ] = False,
    duration: Annotated[
        float | None, option("S", "Simulated time, s [default: until interrupted].")
    ] = None,
    seed: Annotated[int, option("N", "Seed of the scanner's noise.")] = 0,
    domain: DomainOption = None,
    peers: PeersOption = None,
    distribution: DistributionOption = None,
) -> None:
    """Simulate a robot in a ROS 2 graph: any plant, without a ROS installation.

    It takes commands from /cmd_vel, stops if they are older than 0.5 s, and publishes /odom, /tf,
    /joint_states and /robot_description; with a map also /map and /scan.

    For example:

    * `omnidrive ros2 simulate --robot mecanum --plant planar`
    * `omnidrive ros2 simulate --map office.yaml --start 2,3 --clock`
    """
    from math import inf

    from omnidrive.deploy.ros2 import Node
    from omnidrive.deploy.ros2.simulated_robot import Ros2Robot

    options = node_options(domain, peers, distribution)
    made, chosen, pose, grid, rng = _simulated(robot, plant, map, start, seed)
    try:
        with Node("omnidrive_robot", **options) as node:
            settings = _settings(node.distribution, rate, speed, cmd_vel, clock)
            simulated = Ros2Robot(node, made, chosen, pose, settings=settings, grid=grid, rng=rng)
            show(
                f"{chosen.name} on {plant} in domain {node.domain}, {node.distribution}: "
                f"/cmd_vel is geometry_msgs/msg/{settings.command_type}"
            )
            simulated.run(inf if duration is None else duration)
            conclude(
                f"{simulated.commands} commands executed, {simulated.refused} refused, "
                f"{simulated.skipped} steps skipped"
            )
    finally:
        made.close()


def _simulated(robot: str, plant: str, map_name: str | None, start: str, seed: int) -> Any:
    """Return plant, robot, start, map and generator of the scanner."""
    import numpy as np

    from omnidrive.cli.scenario_options import parse_waypoint
    from omnidrive.components import parse_specification
    from omnidrive.geometry import Pose
    from omnidrive.maps import load_map
    from omnidrive.robot import named_robot
    from omnidrive.study import make_plant

    chosen = named_robot(robot)
    x, y, *heading = parse_waypoint("start", start)
    pose = Pose(x, y, heading[0] if heading else 0.0)
    grid = load_map(map_name) if map_name is not None else None
    given = parse_specification(plant)
    made = make_plant(chosen, given.type, obstacles=grid, **given.values)
    return made, chosen, pose, grid, np.random.default_rng(seed)


def _settings(
    distribution: str, rate: float, speed: float, cmd_vel: str | None, clock: bool
) -> Ros2RobotSettings:
    from omnidrive.deploy.ros2.simulated_robot import Ros2RobotSettings

    types = ("Twist", "TwistStamped")
    given: Any = None if cmd_vel is None else choose_one("type of /cmd_vel", cmd_vel, types)
    usual: Any = "Twist" if distribution in {"humble", "iron"} else "TwistStamped"
    return Ros2RobotSettings(rate=rate, speed=speed, command_type=given or usual, clock=clock)


_ReferenceOption = Annotated[
    str | None,
    option(
        "NAME[,KEY=VALUE...]|FILE",
        "Drive this motion once: a waypoint file, or a shape from the robot's pose on, such as "
        "circle or eight [default: follow /plan and /goal_pose].",
        complete=component("references"),
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


@ros2.command()
def drive(
    reference: _ReferenceOption = None,
    params: Annotated[
        Path | None, option("FILE.yaml", "Parameters, in the form of ROS 2 parameter files.")
    ] = None,
    robot: Annotated[
        str | None,
        option("NAME|FILE", "Robot, or a robot file.", None, complete=component("robots")),
    ] = None,
    controller: Annotated[
        str | None,
        option("NAME[,KEY=VALUE...]", "Controller.", None, complete=component("controllers")),
    ] = None,
    rate: Annotated[float | None, option("HZ", "Rate of the loop, Hz.")] = None,
    speed: Annotated[float | None, option("M/S", "Limit of the speed along paths.")] = None,
    world_frame: Annotated[str | None, option("NAME", "Frame of paths and goals.")] = None,
    base_frame: Annotated[str | None, option("NAME", "Frame of the robot.")] = None,
    cmd_vel: Annotated[str | None, option("TOPIC", "Topic of commands.")] = None,
    odom: Annotated[str | None, option("TOPIC", "Topic of odometry.")] = None,
    plan: Annotated[str | None, option("TOPIC", "Topic of paths.")] = None,
    use_sim_time: Annotated[
        bool | None, flag("Use the time of /clock.", None, "--use-sim-time")
    ] = None,
    serve: _ServeOption = False,
    node_name: Annotated[str, option("NAME", "Name of the node.")] = "omnidrive_drive",
    drives: Annotated[
        int | None, option("N", "Number of paths and goals [default: until stopped].", least=1)
    ] = None,
    domain: DomainOption = None,
    peers: PeersOption = None,
    distribution: DistributionOption = None,
) -> None:
    """Drive a robot in a ROS 2 graph with a controller of omnidrive.

    The pose comes from /tf, /odom and /amcl_pose; commands go to /cmd_vel with the type that the
    robot has. It publishes /diagnostics, local_plan and markers. True on /e_stop ends the drive;
    after a hold, true on /omnidrive_drive/arm lets it go on.

    For example:

    * `omnidrive ros2 drive --robot mecanum --reference eight`
    * `omnidrive ros2 drive --params drive.yaml --plan /plan_smoothed`
    * `omnidrive ros2 drive --serve --node-name controller_server`
    """
    options = node_options(domain, peers, distribution)
    settings = _drive_settings(
        params,
        node_name,
        robot=robot, controller=controller, rate=rate, speed=speed, world_frame=world_frame,
        base_frame=base_frame, cmd_vel=cmd_vel, odom=odom, plan=plan, use_sim_time=use_sim_time,
    )  # fmt: skip
    if serve and reference is not None:
        raise InvalidInput("--serve follows the paths of its goals: leave out --reference")
    if not _drive(settings, options, node_name, reference, serve=serve, drives=drives):
        raise typer.Exit(1)


def _drive_settings(params: Path | None, node: str, **options: Any) -> DriveSettings:
    """Return the settings of a file, if there is one, with the options."""
    from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters

    settings = DriveSettings()
    if params is not None:
        settings = settings.with_values(read_parameters(params, node), f"{one_line(str(params))}: ")
    return settings.with_values(options)


def _drive(
    settings: DriveSettings,
    options: dict[str, Any],
    name: str,
    reference: str | None,
    *,
    serve: bool,
    drives: int | None,
) -> bool:
    """Drive, print the end of each drive, and return whether all were finished."""
    from omnidrive.compiled import announce_compiling
    from omnidrive.deploy.links.ros2 import Ros2Link
    from omnidrive.deploy.ros2 import Node
    from omnidrive.deploy.ros2.drive_reports import DriveReports
    from omnidrive.deploy.ros2.follow_path import FollowPathServer
    from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower, PlanFollower

    made = settings.make_robot()
    with Node(name, **options) as node, announce_compiling():
        link = Ros2Link(node, made, settings.link)
        reports = DriveReports(node, link.ros_clock, settings.world_frame)
        pipeline = settings.make_pipeline(made, reports)
        follower = PathFollower(
            link,
            pipeline,
            settings.rate,
            DriveRequests(node, settings.stop),
            speed=settings.speed,
            margin=settings.margin,
        )
        if reference is not None:
            motion = _motion(reference, made, follower.current_pose())
            return _conclude(follower.drive(motion))
        if serve:
            show(f"serving follow_path; the lifecycle of {node.full_name} is unconfigured")
            return all([_conclude(each) for each in FollowPathServer(follower).run(drives)])
        plans = PlanFollower(follower, settings.plan, settings.goal, settings.map)
        show(f"waiting for paths on {settings.plan} and goals on {settings.goal}")
        return all([_conclude(each) for each in plans.run(drives)])


def _motion(text: str, robot: Robot, start: Pose) -> Reference:
    """Return the motion of an option: a waypoint file, or a shape from the robot's pose on."""
    from omnidrive.cli.components import reference_data
    from omnidrive.components import configure
    from omnidrive.reference.components import ReferenceContext

    data = reference_data(text)
    values = {key: value for key, value in data.items() if key != "type"}
    motion: Reference = configure("references", data["type"], values).make(
        ReferenceContext(robot, start)
    )
    return motion


def _conclude(result: DriveResult) -> bool:
    """Print the end of a drive; return whether it was finished."""
    timing = result.timing
    conclude(f"{result.ending}; {timing.misses} late samples, {result.limited} commands limited")
    return result.finished
