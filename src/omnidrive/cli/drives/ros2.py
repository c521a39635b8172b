"""Command `omnidrive ros2`: drive or simulate a robot in a ROS 2 graph, and examine the graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive.cli.completion import component
from omnidrive.cli.drives.ros2_drive import drive
from omnidrive.cli.drives.ros2_node import (
    DistributionOption,
    DomainOption,
    PeersOption,
    node_options,
)
from omnidrive.cli.options import (
    JsonOption,
    choice,
    choose_one,
    flag,
    option,
    parse_waypoint,
    verb_group,
)
from omnidrive.cli.terminal import conclude, print_json, show
from omnidrive.errors import one_line

if TYPE_CHECKING:
    from omnidrive.deploy.ros2.simulated_robot import Ros2RobotSettings
    from omnidrive.ros2.doctor import Examination, Finding

ros2 = verb_group("Drive or simulate a robot in a ROS 2 graph, and examine the graph.")

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
    from omnidrive.parameter import Bounds, check_number
    from omnidrive.ros2 import Node
    from omnidrive.ros2.doctor import diagnose, examine

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
        show(f" {one_line(finding.fact, 500)}", f"{finding.level:<8}", fg=style)
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
    localised: Annotated[
        bool,
        flag("Publish the exact transform from map to odom.", None, "--localised/--not-localised"),
    ] = True,
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

    from omnidrive.deploy.ros2.simulated_robot import Ros2Robot
    from omnidrive.ros2 import Node

    options = node_options(domain, peers, distribution)
    made, chosen, pose, grid, rng = _simulated(robot, plant, map, start, seed)
    try:
        with Node("omnidrive_robot", **options) as node:
            settings = _settings(node.distribution, cmd_vel, rate, speed, localised, clock)
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

    from omnidrive.components import parse_specification
    from omnidrive.geometry import Pose
    from omnidrive.maps import load_map
    from omnidrive.robot import named_robot
    from omnidrive.scenario import make_plant

    chosen = named_robot(robot)
    x, y, *heading = parse_waypoint("start", start)
    pose = Pose(x, y, heading[0] if heading else 0.0)
    grid = load_map(map_name) if map_name is not None else None
    given = parse_specification(plant)
    made = make_plant(chosen, given.type, obstacles=grid, **given.values)
    return made, chosen, pose, grid, np.random.default_rng(seed)


def _settings(
    distribution: str, cmd_vel: str | None, rate: float, speed: float, localised: bool, clock: bool
) -> Ros2RobotSettings:
    from omnidrive.deploy.ros2.simulated_robot import Ros2RobotSettings

    types = ("Twist", "TwistStamped")
    given: Any = None if cmd_vel is None else choose_one("type of /cmd_vel", cmd_vel, types)
    usual: Any = "Twist" if distribution in {"humble", "iron"} else "TwistStamped"
    return Ros2RobotSettings(rate, speed, 0.5, given or usual, localised, clock)


ros2.command()(drive)
