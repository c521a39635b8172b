"""Factories of the controllers of this package, which scenarios name, and their context."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

import numpy as np

from omnidrive import control  # imports only the modules of the controller in use
from omnidrive.choices import PresetName
from omnidrive.control.controller import Controller
from omnidrive.control.feedforward import FeedforwardGains
from omnidrive.control.nmpc import holonomic, unicycle
from omnidrive.control.nmpc.holonomic import HolonomicParameters
from omnidrive.control.pid.options import FuzzyPidOptions, IntervalFuzzyPidOptions, PidOptions
from omnidrive.parameter import Bounds, check_choice
from omnidrive.robot import Robot, force_share

Horizon = Annotated[int, Bounds(1, 200, "steps")]
SolverName = Literal["sqp", "rti", "casadi"]


@dataclass(frozen=True, eq=False)
class ControllerContext:
    """Context of a controller, an argument of its factory.

    Attributes:
        robot: Model of the robot in controllers.
        dt: Sample time, s.
        rng: Generator of random numbers, for controllers that need them; it depends on the seed of
            the run only.
        preset: Preset of the scenario, for controllers with presets.
        forces: Whether motors, masses and friction act; otherwise twists are executed exactly.
        odometry: Whether the pose is estimated from wheel angles, so that slip causes errors.

    Raises:
        InvalidInput: The preset is unknown.
    """

    robot: Robot
    dt: float
    rng: np.random.Generator
    preset: PresetName = "recommended"
    forces: bool = True
    odometry: bool = False

    def __post_init__(self) -> None:
        check_choice("preset", self.preset, get_args(PresetName))


@dataclass(frozen=True)
class UnicycleNmpcOptions:
    """Parameters of the controller `unicycle-nmpc`."""

    preset: Literal["paper", "published-code"] | None = None
    """Weights and limits from the text of the paper or from its published code. None: those of the
    preset of the scenario; `recommended` has the weights of the text and limits of the robot."""
    horizon: Horizon = 15
    """Prediction horizon, in steps of the sample time."""
    solver: SolverName = "sqp"
    """`sqp`: sequential quadratic programming until convergence; `rti`: real-time iteration;
    `casadi`: IPOPT (needs the extra `casadi`)."""


@dataclass(frozen=True)
class HolonomicNmpcOptions:
    """Parameters of the controller `holonomic-nmpc`."""

    horizon: Horizon = 15
    """Prediction horizon, in steps of the sample time."""
    solver: SolverName = "sqp"
    """`sqp`: sequential quadratic programming until convergence; `rti`: real-time iteration;
    `casadi`: IPOPT (needs the extra `casadi`)."""
    weights: HolonomicParameters = field(default_factory=HolonomicParameters)
    """Weights of the cost function."""
    traction: Annotated[float, Bounds(0.1, 100.0, "1")] = force_share.PLANS
    """Maximum acceleration of the predicted motion, as a multiple of that at the friction and
    torque limits."""
    may_spin: bool | None = None
    """Whether the wheels may slip to reduce the tracking error, as long as the measured poses are
    not noisy. Slip makes the error smaller, but the odometry drifts by decimetres in a hard start.
    Set it to false for a robot that measures its pose by odometry only. None: false with an
    estimator, otherwise true."""
    governor: bool = True
    """Whether the robot stays on the path of a reference that its wheels cannot follow in time, and
    arrives later. Other references are not changed."""
    adapt: bool = True
    """Whether gains, lag and delay of the drive are identified during the run and compensated."""


def pid(context: ControllerContext, parameters: PidOptions) -> Controller:
    """PID with constant gains."""
    preset = parameters.preset or context.preset
    return control.classical_pid(
        preset, context.dt, context.robot, forces=context.forces, options=parameters
    )


def fuzzy_t1(context: ControllerContext, parameters: FuzzyPidOptions) -> Controller:
    """PID tuned by a type-1 fuzzy system, as in the paper."""
    return _fuzzy_pid("t1", context, parameters)


def fuzzy_t2(context: ControllerContext, parameters: IntervalFuzzyPidOptions) -> Controller:
    """PID tuned by an interval type-2 fuzzy system, as in the paper."""
    return _fuzzy_pid("t2", context, parameters)


def fuzzy_t3(context: ControllerContext, parameters: IntervalFuzzyPidOptions) -> Controller:
    """PID tuned by an interval type-3 fuzzy system."""
    return _fuzzy_pid("t3", context, parameters)


def _fuzzy_pid(
    kind: Literal["t1", "t2", "t3"], context: ControllerContext, parameters: FuzzyPidOptions
) -> Controller:
    preset = parameters.preset or context.preset
    return control.fuzzy_pid(
        kind, preset, context.dt, context.robot, forces=context.forces, options=parameters
    )


def unicycle_nmpc(context: ControllerContext, parameters: UnicycleNmpcOptions) -> Controller:
    """NMPC with the unicycle model of the paper."""
    chosen = parameters.preset or context.preset
    return control.unicycle_nmpc(
        unicycle.robot_limits(context.robot) if chosen == "recommended" else chosen,
        context.dt,
        horizon=parameters.horizon,
        solver=parameters.solver,
    )


def feedforward(context: ControllerContext, parameters: FeedforwardGains) -> Controller:
    """Feedforward of the motion of the reference with proportional feedback."""
    return control.FeedforwardController(context.dt, parameters)


def holonomic_nmpc(context: ControllerContext, parameters: HolonomicNmpcOptions) -> Controller:
    """NMPC of holonomic robots with limits in wheel space: the recommended controller."""
    may_spin = not context.odometry if parameters.may_spin is None else parameters.may_spin
    if context.forces:
        actuation = holonomic.Actuation.of(context.robot, parameters.traction, may_spin=may_spin)
    else:  # without lag and slip
        actuation = holonomic.Actuation(context.robot.acceleration_faces / parameters.traction)
    return control.holonomic_nmpc(
        context.robot.chassis,
        context.dt,
        horizon=parameters.horizon,
        parameters=parameters.weights,
        solver=parameters.solver,
        actuation=actuation,
        governor=parameters.governor,
        adaptation=parameters.adapt,
    )
