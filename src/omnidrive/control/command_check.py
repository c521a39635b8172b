"""Check of what a controller returns."""

from __future__ import annotations

from omnidrive.control.controller import (
    Command,
    Status,
    WheelSpeeds,
    WheelTorques,
)
from omnidrive.errors import kind_of
from omnidrive.geometry import BodyTwist, WorldTwist
from omnidrive.parameter import are_finite

_VALUES = (BodyTwist, WheelSpeeds, WheelTorques)


def checked_command(command: object, details: int | None) -> Command:
    """Return ``command``; if it is malformed, one with the status ``FAILED`` and a message.

    Args:
        command: What ``Controller.step`` returned.
        details: Number of the controller's ``detail_units``; None: it has none.
    """
    if (
        type(command) is Command
        and type(command.value) in _VALUES
        and are_finite(command.value)
        and (details is None or len(command.details) in {0, details})
    ):
        return command
    return _failed(command, details)


def _failed(command: object, details: int | None) -> Command:
    """Return a command with the status ``FAILED`` whose message describes the error."""
    failed = Command(BodyTwist(0.0, 0.0, 0.0), Status.FAILED)
    if not isinstance(command, Command):
        return failed._replace(
            message=f"it returned {kind_of(command)}, not a Command: {_way_out(command)}"
        )
    value = command.value
    if command.status is Status.FAILED:
        return command if isinstance(value, _VALUES) else failed._replace(message=command.message)
    if not isinstance(value, _VALUES):
        return failed._replace(
            message=f"its command holds {kind_of(value)}, not a BodyTwist, WheelSpeeds or "
            f"WheelTorques: {_way_out(value)}"
        )
    if not are_finite(value):
        name = "twist is" if isinstance(value, BodyTwist) else f"{value.noun} are"
        return failed._replace(message=f"its {name} not finite: {value}")
    if details is not None and len(command.details) not in {0, details}:
        return failed._replace(
            message=f"its command holds {len(command.details)} details, its detail_units {details}"
        )
    return command


def _way_out(value: object) -> str:
    """Return what a controller has to return instead of ``value``."""
    if isinstance(value, WorldTwist):
        return "return Command(to_body(twist, state.pose.yaw))"
    if isinstance(value, _VALUES):
        return f"return Command({type(value).__name__}(...))"
    return "return Command(BodyTwist(vx, vy, yaw_rate))"
