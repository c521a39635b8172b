"""What a writer checks before it writes: that the format can say it."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import hedged_consequent
from omnidrive.fuzzy.system import FuzzySystem


def real(value: float) -> str:
    """The shortest text from which the same number is read."""
    return repr(float(value))


def check_type_1(system: FuzzySystem, language: str) -> None:
    """Refuse a system of type 2 or 3.

    Raises:
        InvalidInput: It is one.
    """
    if system.type > 1:
        raise InvalidInput(
            f"{language} has no sets of type {system.type}; a .fis file has those of type 2"
        )


def check_identifiers(
    system: FuzzySystem, language: str, reserved: Collection[str], functions: Collection[str] = ()
) -> None:
    """Refuse names that the language would not read as one word.

    Args:
        system: Whose variables and sets are checked.
        language: For the message.
        reserved: Its keywords, in lower case; they are none in upper case either.
        functions: Words that it takes for functions, as they are written.

    Raises:
        InvalidInput: A name is none.
    """
    for variable in system.variables:
        check_identifier(variable.name, language, reserved, functions)
        for each in variable.sets:
            check_identifier(each.name, language, reserved, functions)


def check_identifier(
    name: str, language: str, reserved: Collection[str], functions: Collection[str] = ()
) -> None:
    """Refuse a name that the language would not read as one word."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise InvalidInput(
            f"{language} cannot name {name!r}: it has names of letters, digits and _ that do not "
            "begin with a digit; rename it"
        )
    if name.lower() in reserved or name in functions:
        raise InvalidInput(f"{language} cannot name {name!r}: it is a keyword; rename it")


def word(what: str, name: str, words: Mapping[str, str], language: str) -> str:
    """Word of the language for an operator or a defuzzifier.

    Args:
        what: For the message.
        name: Ours.
        words: From our names to theirs.
        language: For the message.

    Raises:
        InvalidInput: It has none.
    """
    if name not in words:
        raise InvalidInput(f"{language} has no {what} {name!r}; it has {', '.join(words)}")
    return words[name]


def check_conclusions(system: FuzzySystem, language: str) -> None:
    """Refuse consequents with "not", which conclude the complement of a set.

    Raises:
        InvalidInput: There is one.
    """
    for number, rule in enumerate(system.rules, 1):
        if hedged := hedged_consequent(rule):
            raise InvalidInput(
                f"rule {number}: {language} cannot conclude {hedged!r}, the complement of a set"
            )
