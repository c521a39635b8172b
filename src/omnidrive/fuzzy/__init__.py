"""Fuzzy systems of type 1, interval type 2 and interval type 3: as data, in files, evaluated."""

from omnidrive.fuzzy.files import GapWarning, SigmaWarning, UnreadBlockWarning, load, save
from omnidrive.fuzzy.inference import FiredRule, Inference
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rule_text import parse_rule, rule_text
from omnidrive.fuzzy.rules import And, Is, Or, Rule
from omnidrive.fuzzy.surface import LookupSurface
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Secondary,
)

__all__ = [
    "And",
    "FiredRule",
    "Footprint",
    "FuzzySet",
    "FuzzySystem",
    "GapWarning",
    "Inference",
    "InputVariable",
    "Is",
    "LinearFunction",
    "LookupSurface",
    "Membership",
    "Or",
    "OutputVariable",
    "Rule",
    "Secondary",
    "SigmaWarning",
    "UnreadBlockWarning",
    "load",
    "parse_rule",
    "rule_text",
    "save",
]
