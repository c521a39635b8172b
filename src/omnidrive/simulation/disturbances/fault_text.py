"""Faults as text on the command line, such as ``wheel-dead:wheel=2,at=5``."""

from __future__ import annotations

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from omnidrive.errors import InvalidInput, suggestion
from omnidrive.files.number_text import parse_number
from omnidrive.simulation.disturbances.fault import FAULTS, Fault, make_fault

_MAX_LENGTH = 200  # characters of a fault
_MAX_SHOWN = 60  # characters of it in a message


def parse_fault(text: str) -> Fault:
    """Parse ``KIND`` or ``KIND:NAME=VALUE,...``, where every value is a number.

    Raises:
        InvalidInput: The kind, a name or a value is invalid; the message lists the valid ones.
    """
    if len(text) > _MAX_LENGTH:
        raise InvalidInput(f"a fault has at most {_MAX_LENGTH} characters, got {len(text)}")
    kind, _, rest = text.partition(":")
    kind = kind.strip()
    if kind not in FAULTS:
        raise InvalidInput(
            f"there is no fault '{_short(kind)}'; there are {', '.join(FAULTS)}"
            + suggestion(kind, list(FAULTS))
        )
    names = [name for name in FAULTS[kind].model_fields if name != "kind"]
    values: dict[str, object] = {}
    for part in filter(None, (part.strip() for part in rest.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if not sign:
            raise InvalidInput(f"fault {kind}: '{_short(part)}' is not NAME=VALUE, such as at=5")
        if name not in names:
            raise InvalidInput(
                f"fault {kind}: there is no '{_short(name)}'; there are {', '.join(names)}"
                + suggestion(name, names)
            )
        if name in values:
            raise InvalidInput(f"fault {kind}: '{name}' is given twice")
        values[name] = _number(kind, name, value)
    try:
        return make_fault(kind, values)
    except ValidationError as error:
        facts = "; ".join(map(_fact, error.errors()))
        raise InvalidInput(f"fault {kind}: {facts}") from None


def _fact(problem: ErrorDetails) -> str:
    """Return the message for one error, which begins with the name of the value."""
    name, message = problem["loc"][-1], problem["msg"]
    if problem["type"] == "value_error":
        return f"{name} {message.removeprefix('Value error, ')}"
    return f"{name}: {message[0].lower()}{message[1:]}"


def _number(kind: str, name: str, value: str) -> float:
    number = parse_number(value)
    if number is None:
        raise InvalidInput(f"fault {kind}: {name} must be a plain number, got '{_short(value)}'")
    return int(number) if number.is_integer() else number


def _short(text: str) -> str:
    """Return ``text`` for a message: shortened, and without control characters."""
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return plain if len(plain) <= _MAX_SHOWN else plain[:_MAX_SHOWN] + "..."
