"""Robot files: YAML of the format ``omnidrive-robot-1``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, fields
from math import isfinite, pi, remainder
from typing import Any, NamedTuple

import yaml

from omnidrive.errors import InvalidInput, InvalidRobot, one_line, short_repr, suggestion
from omnidrive.files.number_text import parse_number
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.robot.mount import Mount
from omnidrive.robot.robot import MAX_WHEELS, Robot
from omnidrive.robot.wheel import OmniWheel

FORMAT = "omnidrive-robot-1"
"""Name and version of the file format."""

_MAX_NAME = 64  # characters
MAX_NUMBER = 1e9
"""Greatest magnitude in a description of a robot, SI units; products of larger numbers overflow."""

_MAX_ANGLE = (6.3, "-6.3 to 6.3 rad (degrees?)")
_LARGEST = {
    "axle_angle": _MAX_ANGLE,
    "roller_angle": _MAX_ANGLE,
    "wheel.radius": (2.0, "at most 2 m (mm?)"),
}
"""Largest magnitude of the numbers whose unit is often mistaken, and the text of the limit."""

_MOUNT_KEYS = {
    "x": "m, of the wheel's centre",
    "y": "m, of the wheel's centre",
    "axle_angle": "rad; the wheel rolls along (-sin axle_angle, cos axle_angle)",
    "roller_angle": "rad; 0 for omni wheels, 0.785 or -0.785 for mecanum wheels",
}
_WHEEL_KEYS = {
    "radius": "m, from the axle to the floor",
    "mass": "kg, hub and rim without rollers",
    "rotor_inertia": "kg m^2, of the motor, reflected to the axle",
    "rollers_per_row": "rollers in each row",
    "roller_radius": "m, largest radius of a roller",
    "roller_mass": "kg, of one roller",
    "row_gap": "m, between the centres of two rows; of a single row, its width",
    "rows": "rows of rollers: 2 for omni wheels, 1 for mecanum wheels",
}
_ROBOT_KEYS = {
    "name": "text",
    "mounts": "one item per wheel",
    "wheel": "properties of the wheels, which are all equal",
    "mass": "kg, with wheels",
    "com": "m, m; x and y of the centre of mass",
    "com_height": "m, of the centre of mass above the floor",
    "body_inertia": "kg m^2, yaw inertia of the robot without wheels about its centre of mass",
    "body_radius": "m, of the smallest circle around the robot",
    "max_wheel_speed": "rad/s, of a motor, at the wheel",
    "max_torque": "N m, of a motor, at the wheel",
    "servo_gain": "N m s/rad, torque per wheel-speed error",
    "motor_lag": "s, time constant of the set points of the wheel-speed servos",
    "friction": "Coulomb coefficient between roller and floor",
    "lag": "s, s; time constants of translation and rotation in response to commands",
    "assumed_effective_radius": "m, in the wheel controller; omit it unless it is miscalibrated",
}
_STRUCTURE = {"name", "mounts", "wheel"}  # all other keys hold numbers
_PAIRS, _INTEGERS = {"com", "lag"}, {"rollers_per_row", "rows"}
_NULLABLE = {"body_inertia", "assumed_effective_radius"}
_REQUIRED_OF_MOUNTS = ("x", "y", "axle_angle")
_HEADER = """\
# Frame B: origin at the centre of the robot, x forward, y left; angles are counter-clockwise.
# A wheel that turns in the positive sense rolls along (-sin axle_angle, cos axle_angle).
# roller_angle is the angle from this direction to the axis of the roller on the floor, positive
# towards the axle: 0 for omni wheels, 0.785 or -0.785 for mecanum wheels.
"""


def is_robot_file(name: str) -> bool:
    """Return whether a text names a robot file, by its suffix, and not a robot."""
    return name.lower().endswith((".yaml", ".yml"))


def load_robot(path: StrPath) -> Robot:
    """Read a robot file.

    Raises:
        InvalidRobot: The file is missing, too large or malformed, a key is unknown or missing, or
            the values are not those of an omnidirectional robot; the message names the key.
    """
    path = to_path(path)
    return parse_robot(read_yaml(path, "robot file", InvalidRobot), str(path))


def parse_robot(data: Any, where: str) -> Robot:
    """Return the robot that the content of a robot file describes.

    Args:
        data: The content: dictionaries, lists, numbers and text.
        where: Source of the data, for messages.

    Raises:
        InvalidRobot: See :func:`load_robot`.
    """
    source = _Source(one_line(where))
    if not isinstance(data, dict):
        raise source.error("it is not a robot file: it contains no keys")
    if data.get("format") != FORMAT:
        raise source.error(f"it needs 'format: {FORMAT}', got {short_repr(data.get('format'))}")
    content = {key: value for key, value in data.items() if key != "format"}
    source.check_keys("", content, _ROBOT_KEYS, _required(Robot))
    values: dict[str, Any] = {"name": source.name(content.pop("name"))}
    mounts = content.pop("mounts")
    if not isinstance(mounts, list) or len(mounts) > MAX_WHEELS:
        raise source.error(f"mounts must be a list of at most {MAX_WHEELS} wheels")
    values["mounts"] = tuple(source.mount(f"mounts[{i}]", each) for i, each in enumerate(mounts))
    wheel = content.pop("wheel")
    source.check_keys("wheel", wheel, _WHEEL_KEYS, _required(OmniWheel))
    parameters = source.numbers("wheel", wheel, _WHEEL_KEYS)
    values |= source.numbers("", content, _ROBOT_KEYS)
    try:
        return Robot(wheel=OmniWheel(**parameters), **values)
    except InvalidInput as error:
        raise source.error(str(error)) from None


def save_robot(robot: Robot, path: StrPath, *, notes: Sequence[str] = ()) -> None:
    """Write a robot file, from which :func:`load_robot` restores every number exactly.

    Angles beyond 6.3 rad are reduced by full turns. An existing file is replaced only when the new
    one is complete.

    Args:
        robot: The robot.
        path: The file.
        notes: Sentences for comments at the top of the file, such as the origin of the numbers.

    Raises:
        InvalidRobot: The name of the robot or a number is not allowed in robot files.
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    text = robot_text(robot, notes=notes)
    with output_file(path) as part:
        part.write_text(text, encoding="utf-8")


def robot_text(robot: Robot, *, notes: Sequence[str] = ()) -> str:
    """Return the content of the robot file of ``robot``; see :func:`save_robot`."""
    lines = [f"# {one_line(note, 1000)}" for note in notes]
    name = yaml.safe_dump({"name": robot.name}, allow_unicode=True, width=1000).rstrip()
    lines += [f"format: {FORMAT}", name, *_HEADER.splitlines(), "mounts:  # m, m, rad, rad"]
    for mount in robot.mounts:
        pairs = ", ".join(f"{key}: {_text(value)}" for key, value in _turned(mount).items())
        lines.append(f"  - {{{pairs}}}")
    lines.append("wheel:  # all wheels are equal")
    lines += _lines(robot.wheel, _WHEEL_KEYS, "  ")
    rest = {key: about for key, about in _ROBOT_KEYS.items() if key not in _STRUCTURE}
    lines += _lines(robot, rest, "")
    text = "\n".join([*lines, ""])
    parse_robot(yaml.safe_load(text), f"robot {robot.name}")  # a file must be readable
    return text


def _turned(mount: Mount) -> dict[str, float]:
    """Return the numbers of a mount, with angles beyond the limit of files reduced by full turns.

    Other angles are restored exactly.
    """
    return {
        key: remainder(value, 2.0 * pi)
        if key in _LARGEST and abs(value) > _LARGEST[key][0]
        else value
        for key, value in mount._asdict().items()
    }


def robot_schema() -> dict[str, Any]:
    """Return the JSON schema of robot files, for editors; descriptions state units."""
    mount = _schema_of(_MOUNT_KEYS, _REQUIRED_OF_MOUNTS)
    wheel = _schema_of(_WHEEL_KEYS, _required(OmniWheel))
    robot = _schema_of(_ROBOT_KEYS, _required(Robot))
    about = _ROBOT_KEYS
    robot["properties"] |= {
        "format": {"const": FORMAT, "description": "name and version of the file format"},
        "name": {"type": "string", "maxLength": _MAX_NAME, "description": about["name"]},
        "mounts": {"type": "array", "items": mount, "maxItems": MAX_WHEELS}
        | {"description": about["mounts"]},
        "wheel": wheel | {"description": about["wheel"]},
    }
    robot["required"].insert(0, "format")
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": "omnidrive robot", **robot}


def _schema_of(keys: Mapping[str, str], required: Collection[str]) -> dict[str, Any]:
    """Return the JSON schema of a dictionary of numbers."""

    def type_of(key: str) -> dict[str, Any]:
        """Return the schema of the value of a key."""
        if key in _PAIRS:
            return {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        kind = "integer" if key in _INTEGERS else "number"
        return {"type": [kind, "null"] if key in _NULLABLE else kind}

    return {
        "type": "object",
        "properties": {key: type_of(key) | {"description": keys[key]} for key in keys},
        "required": [key for key in keys if key in required],
        "additionalProperties": False,
    }


def _lines(owner: Any, keys: Mapping[str, str], indent: str) -> list[str]:
    """Return one line per number, with its unit; None is omitted."""
    return [
        f"{indent}{key}: {_text(getattr(owner, key))}  # {about}"
        for key, about in keys.items()
        if getattr(owner, key) is not None
    ]


def _text(value: Any) -> str:
    """Return a number, or a list of numbers, as YAML reads it: 4e-05 needs a decimal point."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, int):
        return str(value)
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e", 1)


def _required(kind: type[Any]) -> set[str]:
    """Return the names of the fields of a dataclass that have no default."""
    return {each.name for each in fields(kind) if each.default is MISSING}


class _Source(NamedTuple):
    """Checks of a robot file, with its name in every message."""

    where: str

    def error(self, fact: str) -> InvalidRobot:
        """Return the error with the name of the file."""
        return InvalidRobot(f"{self.where}: {fact}")

    def check_keys(
        self, label: str, data: Any, keys: Mapping[str, str], required: Collection[str]
    ) -> None:
        """Check that ``data`` has all required keys and no others."""
        if not isinstance(data, dict):
            shown = short_repr(data)
            raise self.error(f"{label} must hold the keys {', '.join(keys)}, got {shown}")
        within = f" in {label}" if label else ""
        for key in data:
            if key not in keys:
                raise self.error(f"unknown key {short_repr(key)}{within}{_hint(label, key, keys)}")
        for key in keys:
            if key in required and key not in data:
                raise self.error(f"'{key}' is missing{within} ({keys[key]})")

    def name(self, value: Any) -> str:
        """Return the name of the robot."""
        if isinstance(value, str) and value.isprintable() and 0 < len(value) <= _MAX_NAME:
            return value
        raise self.error(
            f"name must be text of 1 to {_MAX_NAME} characters, got {short_repr(value)}"
        )

    def mount(self, label: str, data: Any) -> Mount:
        """Return the mount of one wheel."""
        self.check_keys(label, data, _MOUNT_KEYS, _REQUIRED_OF_MOUNTS)
        return Mount(**self.numbers(label, data, _MOUNT_KEYS))

    def numbers(self, label: str, data: Mapping[str, Any], keys: Mapping[str, str]) -> Any:
        """Return the numbers and pairs of numbers by key; null is the default of its key."""
        values: dict[str, Any] = {}
        for key, value in data.items():
            full = f"{label}.{key}" if label else key
            if value is None and key in _NULLABLE:
                continue
            if key in _PAIRS:
                if not isinstance(value, list) or len(value) != 2:
                    raise self.error(f"{full} must be two numbers ({keys[key]})")
                values[key] = tuple(self.number(full, each, keys[key]) for each in value)
            elif key in _INTEGERS:
                if not isinstance(value, int) or isinstance(value, bool):
                    raise self.error(f"{full} must be an integer, got {short_repr(value)}")
                values[key] = value
            else:
                values[key] = self.number(full, value, keys[key])
        return values

    def number(self, label: str, value: Any, about: str) -> float:
        """Return a finite number."""
        number = _number(value)
        if number is None:
            shown = short_repr(value)
            raise self.error(f"{label} must be a number without a unit ({about}), got {shown}")
        if not (isfinite(number) and abs(number) <= MAX_NUMBER):
            raise self.error(
                f"{label} is {number:g}, need a finite number of at most {MAX_NUMBER:g} in "
                "magnitude"
            )
        key = label.rpartition("].")[2]
        if key in _LARGEST and abs(number) > _LARGEST[key][0]:
            raise self.error(f"{label} is {number:g}, need {_LARGEST[key][1]}")
        return number


def _number(value: Any) -> float | None:
    """Return the number that a YAML value denotes, also as text such as 4e-4; None: none."""
    if isinstance(value, str):
        return parse_number(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)


def _hint(label: str, key: Any, keys: Mapping[str, str]) -> str:
    """Return the end of the message about an unknown key."""
    if label.startswith("mounts") and key in _WHEEL_KEYS:
        return f"; all wheels of a robot are equal: write it once, as wheel.{key}"
    return suggestion(str(key), list(keys), most=len(keys))
