"""Reference page of scenario files, made from their JSON schema.

`python docs/mkdocs/scenario_page.py` writes docs/scenario.md; `make docs` runs it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import yaml

from omnidrive.choices import FaultKind
from omnidrive.components.entry_points import GROUPS, distribution_of, entries_of
from omnidrive.scenario.schema import scenario_schema

PAGE = Path(__file__).parents[1] / "scenario.md"
INTRODUCTION = """# Scenario files

A scenario contains all settings of a study. `omnidrive compare FILE.yaml`, `run` and `plan` read
it, and every run folder contains the complete scenario of its study. Keys with a default may be
omitted. W is the world frame, B the frame of the robot's body.

```yaml
name: first study
robot: {name: small}
map: {source: paper, margin: 0.0}
start: [1.0, 1.0, 0.0]
goal: [8.0, 6.0]
plant: planar
timing: {law: limits}
controllers:
  ours: {type: holonomic-nmpc, horizon: 10}
  feedforward: {type: feedforward}
tasks:
  track: {durations: [20.0]}
```

`omnidrive schema > scenario.json` writes the JSON schema of scenarios. An editor with a YAML
language server completes keys, shows their descriptions and marks errors if the first line of the
file is

    # yaml-language-server: $schema=scenario.json

This page is made from the same schema. It lists the components of omnidrive only; the schema
contains those of other installed packages as well.
"""
TITLES = {
    "RobotSection": "Robot", "plant": "Plants", "MapSection": "Map",
    "MovingSection": "Moving obstacles", "PathOptions": "Path", "CostSection": "Costs",
    "LaneSection": "Lanes", "TimingSection": "Timing",
    "controllers": "Controllers", "reference": "References", "faults": "Faults",
    "WatchdogSection": "Watchdog", "SensorsSection": "Sensors", "EncoderSettings": "Encoders",
    "GyroSettings": "Gyro", "PoseFixSettings": "Pose fixes", "estimator": "Estimators",
    "Tasks": "Tasks", "DurationsTask": "Task track", "NoiseTask": "Task noise",
    "StepTask": "Task step", "HorizonTask": "Task horizon", "FaultsTask": "Task faults",
    "HolonomicParameters": "Weights of holonomic-nmpc",
    "ChannelOptions": "Gains of a PID channel",
    "FuzzyChannelOptions": "Gains of a fuzzy PID channel",
    "FuzzyOptions": "Type-1 fuzzy system", "IntervalFuzzyOptions": "Interval fuzzy system",
    "SetOptions": "Fuzzy sets", "RuleOptions": "Fuzzy rules", "FootprintOptions": "Footprint",
}  # fmt: skip
"""Headings by the class of a section, else by the key; other keys have no section."""


_SIMPLE = {
    "boolean": "`true`, `false`", "string": "text", "null": "`null`", "object": "keys and values"
}  # fmt: skip
_OWN = {
    name
    for group in GROUPS
    for name, entries in entries_of(group).items()
    if distribution_of(entries[0]) == "omnidrive"
}
"""Names of the components of omnidrive."""


def scenario_page() -> str:
    """Return the reference page of scenario files in Markdown."""
    pages = _Pages(scenario_schema())
    body = [*pages.section("Keys", pages.schema, level=2)]
    while pages.waiting:
        body += pages.next_section()
    return "\n".join([INTRODUCTION, *body]).rstrip() + "\n"


class _Pages:
    """Sections of the page; those that a table refers to follow after it."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self.schema = schema
        self.waiting: list[tuple[str, Any]] = []
        self._known: set[str] = set()

    def next_section(self) -> Iterator[str]:
        """Yield the lines of the first section that waits."""
        title, schema = self.waiting.pop(0)
        options = [each for each in self._objects(schema) if each.get("properties")]
        named = [each for each in options if _name(each) in {*_OWN, *get_args(FaultKind)}]
        yield from (f"## {title}", "")
        if not named:
            yield from self.section("", options[0])
            return
        tag = "kind" if "kind" in named[0]["properties"] else "type"
        if title == TITLES["controllers"]:
            yield from ("Every controller has a label, under which tables and figures show it.", "")
        for each in named:
            rest = {k: v for k, v in each["properties"].items() if k != tag}
            yield from self.section(f"`{tag}: {_name(each)}`", each | {"properties": rest}, level=3)

    def section(self, title: str, schema: dict[str, Any], level: int = 0) -> Iterator[str]:
        """Yield heading, description and table of one object."""
        if title:
            yield from ("#" * level + f" {title}", "")
        if schema.get("description") and schema is not self.schema:
            yield from (schema["description"], "")
        rows = [self._row(key, each, schema) for key, each in schema["properties"].items()]
        if rows:
            yield from ("| Key | Value | Default | Description |", "|---|---|---|---|", *rows, "")

    def _row(self, key: str, schema: dict[str, Any], owner: dict[str, Any]) -> str:
        default = "required" if key in owner.get("required", ()) else _yaml(schema.get("default"))
        text = schema.get("description") or self._resolved(schema).get("description", "")
        text = re.sub(r" ?Range: [^|]*$", "", text)
        cells = (f"`{key}`", self._value(key, schema), default, text)
        return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"

    def _value(self, key: str, schema: dict[str, Any]) -> str:
        """Return the valid values of a key, or a link to its section."""
        direct = (schema, *schema.get("anyOf", ()), schema.get("items", {}))
        names = [each["$ref"].split("/")[-1] for each in direct if "$ref" in each]
        title = next((TITLES[name] for name in (*names, key) if name in TITLES), None)
        if title is None or not any(each["properties"] for each in self._objects(schema)):
            return self._values(schema)
        if title not in self._known:
            self._known.add(title)
            self.waiting.append((title, schema))
        absent = " or `null`" if {"type": "null"} in schema.get("anyOf", ()) else ""
        return f"[{title}](#{title.lower().replace(' ', '-')}){absent}"

    def _values(self, schema: dict[str, Any]) -> str:
        """Return a short description of the valid values."""
        schema = self._resolved(schema)
        options = schema.get("anyOf") or schema.get("oneOf")
        if options and "prefixItems" in options[-1]:  # a named tuple
            return f"`[{', '.join(options[0]['properties'])}]`"
        if options:
            return " or ".join(dict.fromkeys(self._values(each) for each in options))
        if "const" in schema or "enum" in schema:
            return ", ".join(f"`{each}`" for each in schema.get("enum", [schema.get("const")]))
        if "prefixItems" in schema:
            return f"[{'; '.join(self._values(each) for each in schema['prefixItems'])}]"
        if "items" in schema:
            return f"list of: {self._values(schema['items'])}"
        return _SIMPLE.get(schema.get("type", "object")) or _number(schema)

    def _objects(self, schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
        """Yield the objects that are valid for a schema, also as items."""
        schema = self._resolved(schema)
        if schema.get("type") == "object":
            inner = schema.get("additionalProperties")
            yield from self._objects(inner) if isinstance(inner, dict) else (schema,)
        elif schema.get("type") == "array" and isinstance(schema.get("items"), dict):
            yield from self._objects(schema["items"])
        for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
            yield from self._objects(each)

    def _resolved(self, schema: dict[str, Any]) -> dict[str, Any]:
        reference = schema.get("$ref")
        return self.schema["$defs"][reference.split("/")[-1]] if reference else schema


def _name(schema: dict[str, Any]) -> str:
    """Return the type or kind of a component or fault; empty for other objects."""
    properties = schema["properties"]
    tag = properties.get("kind") or properties.get("type") or {}
    return str(tag.get("const", ""))


def _number(schema: dict[str, Any]) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    kind = "integer" if schema["type"] == "integer" else "number"
    unit = f" {schema['unit']}" if "unit" in schema else ""
    return f"{kind}, {low:g} to {high:g}{unit}" if low is not None and high is not None else kind


def _yaml(value: Any) -> str:
    value = float(f"{value:.6g}") if isinstance(value, float) else value
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False)
    return f"`{text.removesuffix('...' + chr(10)).strip()}`" if len(text) < 60 else "its defaults"


if __name__ == "__main__":
    PAGE.write_text(scenario_page(), encoding="utf-8")
