"""Truncated logs of runs."""

from dataclasses import fields, replace

import numpy as np


def truncated(run, rows, **changes):
    """Return the first ``rows`` samples of a run, with some columns replaced."""
    columns = {
        f.name: getattr(run, f.name)[:rows]
        for f in fields(run)
        if isinstance(getattr(run, f.name), np.ndarray)
    }
    return replace(run, **{**columns, **changes})
