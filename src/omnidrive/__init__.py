"""Plan, track, simulate and compare trajectory tracking on omnidirectional robots."""

from omnidrive.control import (
    Command,
    Controller,
    FeedforwardController,
    FeedforwardGains,
    FuzzyPidController,
    NmpcController,
    Status,
    TrackingPidController,
    classical_pid,
    fuzzy_pid,
    unicycle_nmpc,
)
from omnidrive.errors import OmnidriveError
from omnidrive.evaluation import Metrics, StepResponse, measure, step_response
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, to_world
from omnidrive.maps import OccupancyGrid, load_nav2_map, paper_map, save_nav2_map
from omnidrive.planning import Path, PathOptions, Place, SplinePath, plan
from omnidrive.reference import Hold, Reference, Setpoint, UniformReference, time_uniformly
from omnidrive.robot import Chassis, Robot, named_robot
from omnidrive.simulation import (
    KinematicPlant,
    Measurement,
    MujocoPlant,
    Outcome,
    PaperNoise,
    Plant,
    Run,
    simulate,
)
from omnidrive.study import Scenario, Study, load_scenario, paper_scenario, run_study

__all__ = [
    "BodyTwist",
    "Chassis",
    "Command",
    "Controller",
    "FeedforwardController",
    "FeedforwardGains",
    "FuzzyPidController",
    "Hold",
    "KinematicPlant",
    "Measurement",
    "Metrics",
    "MujocoPlant",
    "NmpcController",
    "OccupancyGrid",
    "OmnidriveError",
    "Outcome",
    "PaperNoise",
    "Path",
    "PathOptions",
    "Place",
    "Plant",
    "Pose",
    "Reference",
    "Robot",
    "Run",
    "Scenario",
    "Setpoint",
    "SplinePath",
    "Status",
    "StepResponse",
    "Study",
    "TrackingPidController",
    "UniformReference",
    "WorldTwist",
    "classical_pid",
    "fuzzy_pid",
    "load_nav2_map",
    "load_scenario",
    "measure",
    "named_robot",
    "paper_map",
    "paper_scenario",
    "plan",
    "run_study",
    "save_nav2_map",
    "simulate",
    "step_response",
    "time_uniformly",
    "to_body",
    "to_world",
    "unicycle_nmpc",
]
