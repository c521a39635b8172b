"""Check of what a controller returns."""

from __future__ import annotations

from omnidrive.control.controller import (
    Command,
    CommandValue,
    Status,
    WheelSpeeds,
    WheelTorques,
    failed_command,
)
from omnidrive.errors import kind_of, short_repr
from omnidrive.geometry import BodyTwist, WorldTwist
from omnidrive.parameter import are_numbers

_VALUES = (BodyTwist, WheelSpeeds, WheelTorques)
MAX_COMMAND = 1e9
"""Greatest magnitude in a command, m/s, rad/s or N m; products of larger numbers can overflow."""


def checked_command(command: object, details: int | None) -> Command:
    """Return ``command``; if it is malformed, one with the status ``FAILED`` and a message.

    A command with the status ``FAILED`` is returned as zero twist, without details.

    Args:
        command: What ``Controller.step`` returned.
        details: Number of the controller's ``detail_units``; None: it has none.
    """
    if not isinstance(command, Command):
        way_out = _way_out(command)
        return failed_command(f"it returned {kind_of(command)}, not a Command: {way_out}")
    if command.status is Status.FAILED:
        return failed_command(command.message if isinstance(command.message, str) else "")
    fault = _command_fault(command, details)
    return command if fault is None else failed_command(fault)


def _command_fault(command: Command, details: int | None) -> str | None:
    """Return what is wrong with the fields of a command, in one line; None: nothing."""
    value, status, logged, message = command
    if not isinstance(status, Status):
        return f"the status of its command is {kind_of(status)}, not a Status such as Status.OK"
    if not isinstance(value, _VALUES):
        return (
            f"its command holds {kind_of(value)}, not a BodyTwist, WheelSpeeds or WheelTorques: "
            f"{_way_out(value)}"
        )
    if not isinstance(message, str):
        return f"the message of its command is {kind_of(message)}, not a text"
    return _value_fault(value) or _details_fault(logged, details)


def _value_fault(value: CommandValue) -> str | None:
    """Return what is wrong with the numbers of a command; None: nothing."""
    if not are_numbers(value):
        return f"its {_noun(value)} not of numbers: {short_repr(value, 100)}"
    for number in value:
        if not -MAX_COMMAND <= number <= MAX_COMMAND:
            fact = "too large" if number - number == 0 else "not finite"
            return f"its {_noun(value)} {fact}: {short_repr(value, 100)}"
    return None


def _noun(value: CommandValue) -> str:
    return "twist is" if isinstance(value, BodyTwist) else f"{value.noun} are"


def _details_fault(logged: object, details: int | None) -> str | None:
    """Return what is wrong with the details of a command; None: nothing."""
    if details is None:
        return None
    if not isinstance(logged, tuple):
        return f"the details of its command are {kind_of(logged)}, not a tuple"
    if len(logged) not in {0, details}:
        return f"its command holds {len(logged)} details, its detail_units {details}"
    if not are_numbers(logged):
        return f"the details of its command are not all numbers: {short_repr(logged, 100)}"
    return None


def _way_out(value: object) -> str:
    """Return what a controller has to return instead of ``value``."""
    if isinstance(value, WorldTwist):
        return "return Command(to_body(twist, state.pose.yaw))"
    if isinstance(value, _VALUES):
        return f"return Command({type(value).__name__}(...))"
    return "return Command(BodyTwist(vx, vy, yaw_rate))"
