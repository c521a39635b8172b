from .component import Component
from .configured import Configured, OfGroup, configure
from .entry_points import GROUPS, Group, component_names
from .registry import find_component
from .specification import Specification, parse_specification

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
