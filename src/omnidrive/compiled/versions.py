"""Choice between Numba's public interfaces and its internals."""

from __future__ import annotations

import os

import numba

TESTED_VERSIONS = ("0.68",)
"""Versions of Numba with which :mod:`omnidrive.compiled.numba_internals` is tested."""

_version: str = numba.__version__
_IS_TESTED = ".".join(_version.split(".")[:2]) in TESTED_VERSIONS

USES_INTERNALS = _IS_TESTED and os.environ.get("OMNIDRIVE_NUMBA_INTERNALS", "1") != "0"
"""Whether kernels are compiled through internals of Numba; their results are the same."""

VERSION_NOTE = (
    ""
    if _IS_TESTED
    else (
        f"Numba {_version} is used through its public interfaces: kernels compile more slowly than "
        f"with version {' or '.join(TESTED_VERSIONS)}, and have the same results"
    )
)
"""Why the internals are not used; empty: they are, or the environment chooses."""
