"""Checks of a writer that its format supports a system."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import hedged_consequent
from omnidrive.fuzzy.system import FuzzySystem


def number_text(value: float) -> str:
    """Return the shortest text that reads as the same number."""
    return repr(float(value))


def check_type_1(system: FuzzySystem, language: str) -> None:
    """Check that a system is of type 1.

    Raises:
        InvalidInput: It is of type 2 or 3.
    """
    if system.type > 1:
        raise InvalidInput(
            f"{language} does not support sets of type {system.type}; a .fis file supports type 2"
        )


def check_identifiers(
    system: FuzzySystem, language: str, reserved: Collection[str], functions: Collection[str] = ()
) -> None:
    """Check that the names of variables and sets are identifiers of the language.

    Args:
        system: The system to write.
        language: Name of the language, for messages.
        reserved: Keywords of the language, in lower case; they are compared in any case.
        functions: Names of functions of the language; they are compared as written.

    Raises:
        InvalidInput: A name is not an identifier.
    """
    for variable in system.variables:
        check_identifier(variable.name, language, reserved, functions)
        for each in variable.sets:
            check_identifier(each.name, language, reserved, functions)


def check_identifier(
    name: str, language: str, reserved: Collection[str], functions: Collection[str] = ()
) -> None:
    """Check that a name is an identifier; arguments as for :func:`check_identifiers`."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise InvalidInput(
            f"{name!r} is not a valid name in {language}: names consist of letters, digits and _ "
            "and do not begin with a digit; rename it"
        )
    if name.lower() in reserved or name in functions:
        raise InvalidInput(
            f"{name!r} is not a valid name in {language}: it is a keyword; rename it"
        )


def keyword(what: str, name: str, keywords: Mapping[str, str], language: str) -> str:
    """Return the language's keyword of an operator or a defuzzifier.

    Args:
        what: Kind of operator, for messages.
        name: Its name in this package.
        keywords: Keywords of the language by the names in this package.
        language: Name of the language, for messages.

    Raises:
        InvalidInput: The language has no such operator.
    """
    if name not in keywords:
        raise InvalidInput(f"{language} has no {what} {name!r}; it has {', '.join(keywords)}")
    return keywords[name]


def check_consequents(system: FuzzySystem, language: str) -> None:
    """Check that no consequent has the hedge "not", which means the complement of a set.

    Raises:
        InvalidInput: A consequent has it.
    """
    for number, rule in enumerate(system.rules, 1):
        if hedged := hedged_consequent(rule):
            raise InvalidInput(
                f"rule {number}: {language} does not support the consequent {hedged!r}, the "
                "complement of a set"
            )
