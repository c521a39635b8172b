"""Words of the fuzzy control language (FCL), in its two dialects."""

from __future__ import annotations

from typing import Literal, NamedTuple

from omnidrive.fuzzy.rule_text import RESERVED as RULE_WORDS

Dialect = Literal["iec", "fuzzylite"]


class Words(NamedTuple):
    """What a dialect calls the operators."""

    conjunctions: dict[str, str]
    disjunctions: dict[str, str]
    aggregations: dict[str, str]
    methods: dict[str, str]


IEC = Words(
    {
        "min": "MIN",
        "prod": "PROD",
        "lukasiewicz": "BDIF",
        "drastic": "DMIN",
        "nilpotent": "NIPMIN",
        "hamacher": "HAMACHER",
    },
    {
        "max": "MAX",
        "probor": "ASUM",
        "bsum": "BSUM",
        "drastic": "DMAX",
        "nilpotent": "NIPMAX",
        "einstein": "EINSTEIN",
    },
    {"max": "MAX", "bsum": "BSUM", "probor": "PROBOR", "sum": "SUM"},
    {"centroid": "COG", "bisector": "COA", "mom": "MM", "lm": "LM", "rm": "RM", "wtaver": "COGS"},
)
"""IEC 61131-7 with what jFuzzyLogic adds to it."""

FUZZYLITE = Words(
    {
        "min": "MIN",
        "prod": "PROD",
        "lukasiewicz": "BDIF",
        "drastic": "DPROD",
        "einstein": "EPROD",
        "hamacher": "HPROD",
        "nilpotent": "NMIN",
    },
    {
        "max": "MAX",
        "probor": "ASUM",
        "bsum": "BSUM",
        "drastic": "DSUM",
        "einstein": "ESUM",
        "hamacher": "HSUM",
        "nilpotent": "NMAX",
    },
    {
        "max": "MAX",
        "probor": "ASUM",
        "bsum": "BSUM",
        "drastic": "DSUM",
        "einstein": "ESUM",
        "hamacher": "HSUM",
        "nilpotent": "NMAX",
        "sum": "UnboundedSum",
    },
    {**IEC.methods, "wtsum": "COGSS"},
)

ACTIVATIONS = {"min": "MIN", "prod": "PROD"}

WORDS: dict[Dialect, Words] = {"iec": IEC, "fuzzylite": FUZZYLITE}

PARTNERS = {
    "min": "max",
    "prod": "probor",
    "lukasiewicz": "bsum",
    "drastic": "drastic",
    "nilpotent": "nilpotent",
    "hamacher": "einstein",
    "einstein": "einstein",
}
"""The "or" that jFuzzyLogic takes with an "and" (the first of them, for an "or" the "and"): IEC
61131-7 wants pairs. With Hamacher's product it takes Einstein's sum."""


def ours(*tables: dict[str, str]) -> dict[str, str]:
    """From the words of several dialects, in upper case, to our names."""
    return {theirs.upper(): name for table in tables for name, theirs in table.items()}


CONJUNCTIONS = ours(IEC.conjunctions, FUZZYLITE.conjunctions)
DISJUNCTIONS = {**ours(IEC.disjunctions, FUZZYLITE.disjunctions), "PROBOR": "probor"}
AGGREGATIONS = {**ours(IEC.aggregations, FUZZYLITE.aggregations), **DISJUNCTIONS}
METHODS = ours(IEC.methods, FUZZYLITE.methods)

SECTIONS = ("VAR_INPUT", "VAR_OUTPUT", "FUZZIFY", "DEFUZZIFY", "RULEBLOCK", "END_FUNCTION_BLOCK")
BLOCK_WORDS = ("AND", "OR", "ACT", "ACCU", "ENABLED", "RULE", "END_RULEBLOCK")

RESERVED = RULE_WORDS | {
    each.lower()
    for each in (
        *SECTIONS,
        *BLOCK_WORDS,
        *("FUNCTION_BLOCK", "END_VAR", "END_FUZZIFY", "END_DEFUZZIFY", "VAR", "REAL"),
        *("TERM", "RANGE", "METHOD", "DEFAULT", "LOCK", "NC", "TRUE", "FALSE"),
        *("TRIAN", "TRAPE", "GAUSS", "GAUSS2", "GBELL", "SIGM", "DSIGM", "COSINE"),
        *("SINGLETONS", "FUNCTION", "EXP", "LN", "LOG", "SIN", "COS", "TAN", "ABS"),
        *(word for table in IEC for word in table.values()),
    )
}
"""Words that name nothing, in lower case."""
