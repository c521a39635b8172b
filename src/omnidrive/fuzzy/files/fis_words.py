"""Matlab's and Octave's words for operators, and ours: theirs first, of several the usual one."""

from __future__ import annotations

from omnidrive.fuzzy.membership import SHAPES

AND = {
    "min": "min",
    "prod": "prod",
    "algebraic_product": "prod",
    "bounded_difference": "lukasiewicz",
    "drastic_product": "drastic",
    "einstein_product": "einstein",
    "hamacher_product": "hamacher",
    "nilpotent_minimum": "nilpotent",
}
OR = {
    "max": "max",
    "probor": "probor",
    "algebraic_sum": "probor",
    "bounded_sum": "bsum",
    "drastic_sum": "drastic",
    "einstein_sum": "einstein",
    "hamacher_sum": "hamacher",
    "nilpotent_maximum": "nilpotent",
}
IMPLICATION = {"min": "min", "prod": "prod", "algebraic_product": "prod"}
AGGREGATION = {**OR, "sum": "sum"}
DEFUZZIFIER = {
    False: {each: each for each in ("centroid", "bisector", "mom", "som", "lom")},
    True: {each: each for each in ("wtaver", "wtsum")},
}
REDUCTION = {"karnikmendel": "km", "ekm": "ekm", "iasc": "iasc", "eiasc": "eiasc"}
SHAPE_NAMES = tuple(each for each in SHAPES if each != "pointsmf")
