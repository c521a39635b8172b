"""Words of the fuzzylite language (FLL)."""

from __future__ import annotations

from omnidrive.fuzzy.variables import Defuzzifier

CONJUNCTIONS = {
    "min": "Minimum",
    "prod": "AlgebraicProduct",
    "lukasiewicz": "BoundedDifference",
    "drastic": "DrasticProduct",
    "einstein": "EinsteinProduct",
    "hamacher": "HamacherProduct",
    "nilpotent": "NilpotentMinimum",
}
DISJUNCTIONS = {
    "max": "Maximum",
    "probor": "AlgebraicSum",
    "bsum": "BoundedSum",
    "drastic": "DrasticSum",
    "einstein": "EinsteinSum",
    "hamacher": "HamacherSum",
    "nilpotent": "NilpotentMaximum",
}
AGGREGATIONS = {**DISJUNCTIONS, "sum": "UnboundedSum"}
IMPLICATIONS = {"min": "Minimum", "prod": "AlgebraicProduct"}
DEFUZZIFIERS: dict[Defuzzifier, str] = {
    "centroid": "Centroid",
    "bisector": "Bisector",
    "mom": "MeanOfMaximum",
    "lm": "SmallestOfMaximum",
    "rm": "LargestOfMaximum",
    "wtaver": "WeightedAverage",
    "wtsum": "WeightedSum",
}
"""fuzzylite's smallest maximum is the leftmost, not, as Matlab's, that of smallest magnitude."""

_VARIABLE = frozenset({"description", "enabled", "range", "lock-range", "term"})
KEYS = {
    "Engine": frozenset({"description"}),
    "InputVariable": _VARIABLE,
    "OutputVariable": _VARIABLE
    | {"aggregation", "accumulation", "defuzzifier", "default", "lock-previous", "lock-valid"},
    "RuleBlock": frozenset(
        {
            "description",
            "enabled",
            "conjunction",
            "disjunction",
            "implication",
            "activation",
            "rule",
        }
    ),
}
"""What each component may hold; accumulation and lock-valid are fuzzylite 5's words."""
