"""The controllers of one file each, by the names of their files."""

from pkgutil import iter_modules

import numpy as np

from omnidrive.components import find_component
from omnidrive.control import laws
from omnidrive.control.components import ControllerContext

ONE_FILE_LAWS = [each.name.replace("_", "-") for each in iter_modules(laws.__path__)]


def one_file_law(name, robot, dt=0.1, *, forces=False, **parameters):
    """Return a controller as a scenario makes it; by default for a plant without forces."""
    component = find_component("controllers", name)
    context = ControllerContext(robot, dt, np.random.default_rng(1), forces=forces)
    return component.make(context, component.parse(parameters))
