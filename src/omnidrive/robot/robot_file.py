"""Robot files: YAML of the format ``omnidrive-robot-1``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from math import isfinite, pi, remainder
from typing import Any

import yaml

from omnidrive.errors import InvalidInput, InvalidRobot, one_line, short_repr, suggestion
from omnidrive.files.number_text import parse_number
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.robot.mount import Mount
from omnidrive.robot.outline import outline_faults, outline_of, outline_radius
from omnidrive.robot.robot import MAX_WHEELS, Robot, robot_faults
from omnidrive.robot.wheel import OmniWheel, wheel_faults

FORMAT = "omnidrive-robot-1"
"""Name and version of the file format."""

_MAX_NAME = 64  # characters
_MAX_FAULTS = 10  # faults that one message names
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
    "outline": "m, m; corners (x, y) of the body from above; then body_radius may be omitted",
    "max_wheel_speed": "rad/s, of a motor, at the wheel",
    "max_torque": "N m, of a motor, at the wheel",
    "servo_gain": "N m s/rad, torque per wheel-speed error",
    "motor_lag": "s, time constant of the set points of the wheel-speed servos",
    "friction": "Coulomb coefficient between roller and floor",
    "lag": "s, s; time constants of translation and rotation in response to commands",
    "assumed_effective_radius": "m, in the wheel controller; omit it unless it is miscalibrated",
    "drive_gain": "1, 1, 1; ratio of the body twist to the commanded one along x, y and yaw",
}
_STRUCTURE = {"name", "mounts", "wheel"}  # all other keys hold numbers
_LENGTHS = {"com": 2, "lag": 2, "drive_gain": 3}  # of lists
_INTEGERS = {"rollers_per_row", "rows"}
_NULLABLE = {"body_inertia", "assumed_effective_radius", "outline"}
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
        InvalidRobot: The file is missing, too large or malformed, keys are unknown or missing, or
            the values are not those of an omnidirectional robot; the message names the first ten
            faults with their keys.
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
    content = _with_radius({key: value for key, value in data.items() if key != "format"})
    values = source.numbers("", content, _ROBOT_KEYS, Robot)
    source.check_name(content.get("name", "robot"))
    mounts = source.mounts(content.get("mounts", []))
    absent = "wheel" not in content
    parameters = {} if absent else source.numbers("wheel", content["wheel"], _WHEEL_KEYS, OmniWheel)
    for fault in (*wheel_faults(parameters), *robot_faults(values)):
        source.add(fault)
    if source.faults:
        raise source.error("; ".join(source.faults))
    try:
        wheel = OmniWheel(**parameters)
        return Robot(name=content["name"], mounts=mounts, wheel=wheel, **values)
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


def _with_radius(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content with the radius of the outline if it has no radius of the body."""
    if "body_radius" in content or content.get("outline") is None:
        return content
    source = _Source("")
    outline = source.outline(content["outline"])
    faulty = outline is None or outline_faults(outline, None)
    return {**content, "body_radius": 1.0 if faulty else outline_radius(outline)}


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
    mount = _schema_of(_MOUNT_KEYS, _required(Mount))
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
    robot["required"].remove("body_radius")
    robot["anyOf"] = [{"required": [key]} for key in ("body_radius", "outline")]
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": "omnidrive robot", **robot}


def _schema_of(keys: Mapping[str, str], required: Collection[str]) -> dict[str, Any]:
    """Return the JSON schema of a dictionary of numbers."""

    def type_of(key: str) -> dict[str, Any]:
        """Return the schema of the value of a key."""
        if key == "outline":
            corner = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
            return {"type": ["array", "string", "null"], "items": corner, "minItems": 3}
        if key in _LENGTHS:
            n = _LENGTHS[key]
            return {"type": "array", "items": {"type": "number"}, "minItems": n, "maxItems": n}
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
    """Return the names of the fields of a dataclass or NamedTuple that have no default."""
    if not is_dataclass(kind):
        return {*kind._fields} - {*kind._field_defaults}
    return {each.name for each in fields(kind) if each.default is MISSING}


@dataclass(frozen=True, slots=True)
class _Source:
    """Checks of a robot file, which collect its faults."""

    where: str
    """Name of the file, for messages."""
    faults: list[str] = field(default_factory=list)

    def add(self, fault: str) -> None:
        """Add a fault; raise the error with all of them if there are more than ten."""
        if len(self.faults) == _MAX_FAULTS:
            raise self.error("; ".join([*self.faults, "and more"]))
        self.faults.append(fault)

    def error(self, fact: str) -> InvalidRobot:
        """Return the error with the name of the file."""
        return InvalidRobot(f"{self.where}: {fact}")

    def check_keys(
        self, label: str, data: Any, keys: Mapping[str, str], required: Collection[str]
    ) -> None:
        """Check that ``data`` has all required keys and no others."""
        within = f" in {label}" if label else ""
        for key in data:
            if key not in keys:
                self.add(f"unknown key {short_repr(key)}{within}{_hint(label, key, keys)}")
        for key in keys:
            if key in required and key not in data:
                self.add(f"'{key}' is missing{within} ({keys[key]})")

    def check_name(self, value: Any) -> None:
        """Check the name of the robot."""
        if not (isinstance(value, str) and value.isprintable() and 0 < len(value) <= _MAX_NAME):
            self.add(f"name must be text of 1 to {_MAX_NAME} characters, got {short_repr(value)}")

    def mounts(self, data: Any) -> tuple[Mount, ...]:
        """Return the mounts of the wheels, as far as they have no faults."""
        if not isinstance(data, list) or len(data) > MAX_WHEELS:
            self.add(f"mounts must be a list of at most {MAX_WHEELS} wheels")
            return ()
        found = [
            self.numbers(f"mounts[{i}]", each, _MOUNT_KEYS, Mount) for i, each in enumerate(data)
        ]
        return () if self.faults else tuple(Mount(**each) for each in found)

    def numbers(
        self, label: str, data: Any, keys: Mapping[str, str], kind: type[Any]
    ) -> dict[str, Any]:
        """Check the keys of ``kind`` and return its numbers and pairs of numbers without faults.

        Null is the default of its key.
        """
        if not isinstance(data, dict):
            self.add(f"{label} must hold the keys {', '.join(keys)}, got {short_repr(data)}")
            return {}
        self.check_keys(label, data, keys, _required(kind))
        values: dict[str, Any] = {}
        for key in keys:
            if key in _STRUCTURE or key not in data or (data[key] is None and key in _NULLABLE):
                continue
            value = self.value(f"{label}.{key}" if label else key, key, data[key], keys[key])
            if value is not None:
                values[key] = value
        return values

    def value(self, label: str, key: str, value: Any, about: str) -> Any:
        """Return the number or the list of numbers of a key; None if it has a fault."""
        if key == "outline":
            return self.outline(value)
        if key in _LENGTHS:
            if not isinstance(value, list) or len(value) != _LENGTHS[key]:
                count = "two" if _LENGTHS[key] == 2 else "three"
                self.add(f"{label} must be {count} numbers ({about})")
                return None
            numbers = tuple(self.number(label, each, about) for each in value)
            return None if None in numbers else numbers
        if key not in _INTEGERS:
            return self.number(label, value, about)
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        self.add(f"{label} must be an integer, got {short_repr(value)}")
        return None

    def outline(self, value: Any) -> Any:
        """Return the corners of the outline; None if one has a fault."""
        try:
            corners = outline_of(value)
        except ValueError as error:
            self.add(f"outline {error}")
            return None
        if not isinstance(corners, list) or not all(
            isinstance(each, list) and len(each) == 2 for each in corners
        ):
            about = f"a list of corners [x, y] in m, got {short_repr(value)}"
            self.add(f"outline must be {about}")
            return None
        found = tuple(
            tuple(self.number(f"outline[{i}]", each, "m") for each in corner)
            for i, corner in enumerate(corners)
        )
        return None if any(None in corner for corner in found) else found

    def number(self, label: str, value: Any, about: str) -> float | None:
        """Return a finite number; None if it has a fault."""
        number = _number(value)
        key = label.rpartition("].")[2]
        if number is None:
            shown = short_repr(value)
            self.add(f"{label} must be a number without a unit ({about}), got {shown}")
        elif not (isfinite(number) and abs(number) <= MAX_NUMBER):
            self.add(
                f"{label} is {number:g}, need a finite number of at most {MAX_NUMBER:g} in "
                "magnitude"
            )
        elif key in _LARGEST and abs(number) > _LARGEST[key][0]:
            self.add(f"{label} is {number:g}, need {_LARGEST[key][1]}")
        else:
            return number
        return None


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
    return suggestion(str(key), list(keys), maximum=len(keys))
