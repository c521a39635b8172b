from .component import Component
from .configured import Configured, OfGroup, configure
from .entry_points import GROUPS, Group, component_names
from .fields import plain
from .parameters import Parameter, parameters_of
from .registry import find_component
from .specification import Specification, parse_specification

__all__ = [
    "GROUPS",
    "Component",
    "Configured",
    "Group",
    "OfGroup",
    "Parameter",
    "Specification",
    "component_names",
    "configure",
    "find_component",
    "parameters_of",
    "parse_specification",
    "plain",
]
