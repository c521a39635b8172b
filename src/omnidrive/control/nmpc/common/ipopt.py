"""CasADi and IPOPT: settings and import. Needs the extra ``casadi``."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Annotated, NamedTuple

from omnidrive.errors import MissingExtra
from omnidrive.parameter import Bounds


class IpoptSettings(NamedTuple):
    """Stopping criteria of IPOPT."""

    tolerance: Annotated[float, Bounds(1e-12, 1e-2, "1")] = 1e-9
    """IPOPT's ``tol``: tolerance of the scaled optimality error."""
    max_iterations: Annotated[int, Bounds(1, 3000, "1")] = 200
    """IPOPT's ``max_iter``, for each solution."""

    def options(self) -> dict[str, object]:
        """Return the options of CasADi's ``nlpsol``: these settings, and no text output."""
        return {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",  # suppress the banner
            "ipopt.tol": self.tolerance,
            "ipopt.max_iter": self.max_iterations,
        }


def casadi() -> ModuleType:
    """Import CasADi.

    Raises:
        MissingExtra: CasADi is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise MissingExtra(
            "solver 'casadi' needs CasADi, which is not installed: "
            "pip install casadi, or choose solver 'sqp'"
        ) from error
