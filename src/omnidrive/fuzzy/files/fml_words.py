"""Words of the fuzzy markup language (FML), IEEE 1855-2016."""

from __future__ import annotations

from omnidrive.fuzzy.rules import Hedge
from omnidrive.fuzzy.variables import Defuzzifier

NAMESPACE = "http://www.ieee1855.org"

RANGE = "omnidrive"
"""Target of the processing instruction that notes the range of a Sugeno output."""

CONJUNCTIONS = {
    "min": "MIN",
    "prod": "PROD",
    "lukasiewicz": "BDIF",
    "drastic": "DRP",
    "einstein": "EPROD",
    "hamacher": "HPROD",
    "nilpotent": "NILMIN",
}
"""As the standard's text has them; its schema calls two of them BSUM and DRS."""

DISJUNCTIONS = {
    "max": "MAX",
    "probor": "PROBOR",
    "bsum": "BSUM",
    "drastic": "DRS",
    "einstein": "ESUM",
    "hamacher": "HSUM",
    "nilpotent": "NILMAX",
}
AGGREGATIONS = DISJUNCTIONS
ACTIVATIONS = {"min": "MIN", "prod": "PROD"}
DEFUZZIFIERS: dict[str, str] = {
    "centroid": "COG",
    "bisector": "COA",
    "mom": "MOM",
    "lm": "LM",
    "rm": "RM",
}
MODIFIERS: dict[Hedge, str] = {
    "not": "not",
    "any": "any",
    "very": "very",
    "somewhat": "somewhat",
    "extremely": "intensify",
    "seldom": "seldom",
}
"""IEEE 1855's "extremely" is the cube; what fuzzylite calls so is its "intensify"."""

READ_CONJUNCTIONS = {v: k for k, v in CONJUNCTIONS.items()} | {
    "BSUM": "lukasiewicz",
    "DRS": "drastic",
}
READ_DISJUNCTIONS = {v: k for k, v in DISJUNCTIONS.items()}
READ_ACTIVATIONS = {v: k for k, v in ACTIVATIONS.items()}
READ_DEFUZZIFIERS: dict[str, Defuzzifier] = {
    "COG": "centroid",
    "COA": "bisector",
    "MOM": "mom",
    "LM": "lm",
    "RM": "rm",
}
READ_MODIFIERS: dict[str, Hedge] = {v: k for k, v in MODIFIERS.items()}
