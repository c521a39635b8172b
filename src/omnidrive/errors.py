"""Exceptions of the package, and texts for their messages.

OmnidriveError
├── InvalidInput(ValueError)      an argument outside its documented domain
│   ├── ComponentFailed           a factory of a component raised an exception
│   ├── InvalidFuzzyFile          a missing, malformed or too large file of a fuzzy system
│   ├── InvalidGeometry           wheels that cannot produce every planar twist
│   ├── InvalidLog                a missing, malformed or too large log of a drive
│   ├── InvalidMessage            bytes or values that are no message of its type
│   ├── InvalidMap                a missing, malformed or too large map file
│   ├── InvalidWaypoint           a start or goal outside the map or in collision
│   ├── InvalidRobot              a missing, malformed or too large robot file
│   ├── InvalidReference          times that do not increase, inconsistent shapes, a motion too
│   │                             fast for the robot, a bad waypoint file
│   ├── InvalidScenario           an unknown key, or a value of wrong type, unit or range
│   ├── InvalidStudy              an unknown axis, or a value that its scenario refuses
│   ├── InvalidStore              a database of a study that is missing, damaged or foreign
│   └── InvalidScene              a simulator scene without an object that the settings name
├── NoPathFound                   no path from start to goal exists
├── MissingExtra                  an optional dependency is not installed
├── PlantLost                     the connection to the simulator of a plant failed
├── CannotWrite                   results cannot be written
├── CannotDraw                    OpenGL or a display is missing
├── WorkerLost                    worker processes end while they start, or a scheduler is lost
└── RunFailed                     a run or a compilation failed; raised by ``raise_if_failed()``
                                  and ``warm_up()`` only

Messages state the fact and how to correct it.
"""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Iterable, Set
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path


class OmnidriveError(Exception):
    """Base class of all exceptions of the package."""


class InvalidInput(OmnidriveError, ValueError):
    """An argument is outside its documented domain."""


class ComponentFailed(InvalidInput):
    """A factory of a component raised an exception, which is the cause of this one."""


class InvalidFuzzyFile(InvalidInput):
    """A file does not contain a valid fuzzy system."""


class InvalidGeometry(InvalidInput):
    """The wheel layout cannot produce every planar twist.

    Args:
        rank: Rank of the wheel matrix.
        fact: The cause and the way out.
    """

    def __init__(
        self, rank: int, fact: str = "not omnidirectional; turn a wheel or add one"
    ) -> None:
        super().__init__(f"wheel matrix has rank {rank}, need 3: {fact}")
        self.rank, self.fact = rank, fact

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the constructor arguments, so that the error can be sent between processes."""
        return type(self), (self.rank, self.fact)


class InvalidLog(InvalidInput):
    """The log of a drive is malformed."""


class InvalidMap(InvalidInput):
    """A map cannot be read."""


class InvalidMessage(InvalidInput):
    """Bytes from a network or a log, or values, are no message of the stated type."""


class InvalidWaypoint(InvalidInput):
    """A start or goal lies outside the map or collides with an obstacle."""


class InvalidRobot(InvalidInput):
    """A robot file, or a file from which a robot is imported or identified, cannot be used."""


class InvalidReference(InvalidInput):
    """A reference is inconsistent, or the robot cannot follow it."""


class InvalidScenario(InvalidInput):
    """A scenario has an unknown key or an invalid value."""


class InvalidStudy(InvalidInput):
    """A study file has an unknown key or axis, or an invalid value."""


class InvalidScene(InvalidInput):
    """A simulator scene lacks an object that the settings name."""


class InvalidStore(InvalidInput):
    """The database of a study is missing, damaged, of another program or of a newer version."""


class NoPathFound(OmnidriveError):
    """There is no path from start to goal."""


class NoPathYet(NoPathFound):
    """No path was found within the time limit; there may be one."""


class MissingExtra(OmnidriveError):
    """A required optional dependency is not installed."""


class PlantLost(OmnidriveError):
    """The simulator or robot of a plant cannot be reached, or the connection was lost.

    Raised by ``step`` of a plant, it ends the run; the log of the run is kept.
    """


class CannotWrite(OmnidriveError):
    """Results cannot be written."""


class CannotDraw(OmnidriveError):
    """OpenGL, or a display for the window, is not available."""


class WorkerLost(OmnidriveError):
    """Worker processes end while they start, or the scheduler of a cluster is lost."""


class RunFailed(OmnidriveError):
    """A run, or the compilation of kernels in advance, did not finish."""


PART_ERRORS = (Exception, SystemExit, GeneratorExit)
"""Exceptions by which a component, such as a user's controller, ends its own run only."""


def failure_reason(error: BaseException) -> str:
    """Return type, message, file and line of a component's exception, in one line.

    It has at most 300 characters, and names the innermost line outside this package and the
    libraries; none if there is no such line.
    """
    try:
        message = str(error)
    except Exception as second:
        message = f"its message raises {kind_of(second)}"
    name, lines = type(error).__name__, message.splitlines()
    reason = f"{name}: {lines[0]}" if lines else name
    own = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(_LIBRARIES)
    ]
    if not own:
        return one_line(reason)
    place = f" ({one_line(Path(own[-1].filename).name, 60)}, line {own[-1].lineno})"
    return one_line(reason, 300 - len(place)) + place


_LIBRARIES = (
    str(Path(__file__).parent),
    *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")),
    "<frozen ",
)
"""First parts of the names of files that are no users' code."""


def traceback_text(error: BaseException) -> str:
    """Return the traceback of a component's exception, with the innermost four calls only."""
    return "".join(traceback.format_exception(error, limit=-4)).rstrip()


def closest(name: str, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the known name most similar to ``name``, None if the ratio is below ``cutoff``.

    The similarity ratio, 0 to 1, is that of difflib; case is ignored.
    """
    names = {each.lower(): each for each in reversed(list(known))}
    found = get_close_matches(name[:100].lower(), names, n=1, cutoff=cutoff)
    return names[found[0]] if found else None


def suggestion(name: str, known: Iterable[str], *, maximum: int = 12) -> str:
    """Return the end of an error message about an unknown name.

    It is ``; did you mean 'a'?`` if a known name is similar, otherwise ``; there are a, b`` with at
    most ``maximum`` names: of more, the nearest. Those of a set are in alphabetic order. The names
    may come from a file: they are shown as one line, cut if long.
    """
    ordered = sorted(known) if isinstance(known, Set) else known
    names = [one_line(each, 60) for each in ordered]
    near = closest(name, names)
    if near is not None:
        return f"; did you mean '{near}'?"
    if len(names) > maximum:
        names.sort(
            key=lambda each: -SequenceMatcher(None, name[:100].lower(), each.lower()).ratio()
        )
    return f"; there are {', '.join(names[:maximum])}{', ...' if len(names) > maximum else ''}"


def kind_of(value: object) -> str:
    """Return the type of a value with its article for messages, such as ``a tuple``."""
    if value is None:
        return "None"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    name = type(value).__name__
    return f"an {name}" if name[0] in "aeiouAEIOU" or name == "ndarray" else f"a {name}"


def one_line(text: str, limit: int = 300) -> str:
    """Return ``text`` with unprintable characters escaped, truncated to ``limit`` characters."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return line if len(line) <= limit else line[: limit - 3] + "..."


def short_repr(value: object, limit: int = 60) -> str:
    """Return the representation of a value for messages: one line of at most ``limit`` characters.

    A value whose ``repr`` raises an exception is described by :func:`kind_of`.
    """
    try:
        text = repr(value)
    except Exception:  # of any class, also a user's
        return kind_of(value)
    return one_line(text, limit)
