"""Components: controllers, plants, robots, maps, estimators and references, found by name."""

from omnidrive.components.component import Component
from omnidrive.components.configured import Configured, OfGroup, configure
from omnidrive.components.registry import GROUPS, Group, component_names, find_component
from omnidrive.components.specification import Specification, parse_specification

__all__ = [
    "GROUPS",
    "Component",
    "Configured",
    "Group",
    "OfGroup",
    "Specification",
    "component_names",
    "configure",
    "find_component",
    "parse_specification",
]
