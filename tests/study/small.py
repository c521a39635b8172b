"""Scenarios whose studies take a few seconds."""

from omnidrive.scenario import paper_scenario
from omnidrive.scenario.tasks import DurationsTask, HorizonTask, NoiseTask, StepTask, Tasks


def small_scenario(**changes):
    """Return a scenario with one short run of every task but `faults`, on the kinematic plant."""
    tasks = Tasks(
        track=DurationsTask(durations=(20.0,)),
        noise=NoiseTask(durations=(20.0,)),
        step=StepTask(displacement=(1.0, 1.0, 0.7), duration=4.0),
        horizon=HorizonTask(duration=20.0, horizons=(5,)),
    )
    return paper_scenario().with_values(**{"plant": "kinematic", "tasks": tasks, **changes})


def noise_scenario(repeats, **changes):
    """Return a scenario with the task `noise` only, repeated with several seeds."""
    tasks = Tasks(noise=NoiseTask(durations=(20.0,), repeats=repeats))
    names = ("fuzzy_t1", "fuzzy_t2", "holonomic-nmpc")
    return small_scenario(**{"tasks": tasks, "controllers": names, **changes})
