"""Every exception this package raises on purpose.

OmnidriveError
├── InvalidInput(ValueError)      a caller passed a value the docs forbid
│   ├── InvalidFuzzyFile          a fuzzy system's file that is missing, malformed or too large
│   ├── InvalidGeometry           a chassis whose wheels cannot produce every twist
│   ├── InvalidMap                a map file that is missing, malformed or too large
│   ├── InvalidWaypoint           a start or goal outside the map or inside an obstacle
│   ├── InvalidReference          times not increasing, shapes that disagree, too fast for the
│   │                             robot, a waypoint file that is missing, malformed or too large
│   ├── InvalidScenario           a scenario with an unknown key, a wrong unit, sign or range
│   └── InvalidScene              a simulator's scene without what the settings name
├── NoPathFound                   the planner proved there is none
├── MissingExtra                  an optional dependency is not installed
├── PlantLost                     a simulator behind a plant cannot be reached, or went away
├── CannotWrite                   the run folder cannot be made or has no room left
├── CannotDraw                    no OpenGL to draw with, or no display for a window
├── WorkerLost                    a process that did some of the runs was killed
└── RunFailed                     raised only on request, by ``Run.raise_if_failed()``

All but ``RunFailed`` are the user's to mend; their messages name the fact and the way out.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class OmnidriveError(Exception):
    """Base class: ``except OmnidriveError`` catches everything raised on purpose."""


class InvalidInput(OmnidriveError, ValueError):
    """A caller passed a value outside its documented domain."""


class InvalidFuzzyFile(InvalidInput):
    """A file that does not hold a fuzzy system."""


class InvalidGeometry(InvalidInput):
    """The wheel layout cannot produce every planar twist."""

    def __init__(self, rank: int) -> None:
        super().__init__(
            f"wheel matrix has rank {rank}, need 3: not omnidirectional; turn a wheel or add one"
        )
        self.rank = rank

    def __reduce__(self) -> tuple[type[InvalidGeometry], tuple[int]]:
        """Pickle by the argument, so that the error survives the way from a worker process."""
        return type(self), (self.rank,)


class InvalidMap(InvalidInput):
    """A map that cannot be read."""


class InvalidWaypoint(InvalidInput):
    """A start or goal where the robot cannot stand."""


class InvalidReference(InvalidInput):
    """A reference that contradicts itself, or that the robot cannot follow."""


class InvalidScenario(InvalidInput):
    """A scenario that does not say what it means."""


class InvalidScene(InvalidInput):
    """A simulator's scene that does not hold what the settings name."""


class NoPathFound(OmnidriveError):
    """There is no way from start to goal."""


class MissingExtra(OmnidriveError):
    """An optional dependency is needed and not installed."""


class PlantLost(OmnidriveError):
    """The simulator or robot behind a plant cannot be reached, or went away.

    Raised by a plant's ``step`` it ends the run, whose log is kept.
    """


class CannotWrite(OmnidriveError):
    """Results cannot be written."""


class CannotDraw(OmnidriveError):
    """There is nothing to draw a picture with, or nowhere to show it."""


class WorkerLost(OmnidriveError):
    """A worker process ended before its run did."""

    def __init__(self) -> None:
        super().__init__(
            "a worker process was killed, perhaps for want of memory; what was finished before is "
            "kept. One run at a time needs the least memory: --jobs 1 (in Python: processes=1). "
            "Scripts that use several processes do so under: if __name__ == '__main__'"
        )


class RunFailed(OmnidriveError):
    """A run did not reach its end."""


def closest(name: str, known: Iterable[str], *, cutoff: float = 0.5) -> str | None:
    """The known name most similar to ``name``, or None if the similarity ratio is below ``cutoff``.

    The ratio is difflib's, 0 to 1; case is ignored.
    """
    names = {each.lower(): each for each in reversed(list(known))}
    found = get_close_matches(name[:100].lower(), names, n=1, cutoff=cutoff)
    return names[found[0]] if found else None


def suggestion(name: str, known: Iterable[str], *, most: int = 12) -> str:
    """End of an error message about an unknown name.

    ``; did you mean 'a'?`` if a name is similar, else ``; there are a, b`` with at most ``most``
    names.
    """
    names = list(known)
    near = closest(name, names)
    if near is not None:
        return f"; did you mean '{near}'?"
    return f"; there are {', '.join(names[:most])}{', ...' if len(names) > most else ''}"
