"""Logs of runs, cut short."""

from dataclasses import fields, replace

import numpy as np


def cut(run, rows, **changes):
    """The run's first ``rows`` samples, some columns replaced."""
    columns = {
        f.name: getattr(run, f.name)[:rows]
        for f in fields(run)
        if isinstance(getattr(run, f.name), np.ndarray)
    }
    return replace(run, **{**columns, **changes})
