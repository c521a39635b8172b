"""A study that takes a second or two."""

from omnidrive.study import paper_scenario
from omnidrive.study.scenario import DurationsTask, HorizonTask, StepTask, Tasks


def small_scenario(**changes):
    """All tasks, briefly, on the kinematic plant."""
    tasks = Tasks(
        track=DurationsTask(durations=(20.0,)),
        noise=DurationsTask(durations=(20.0,)),
        step=StepTask(displacement=(1.0, 1.0, 0.7), duration=4.0),
        horizon=HorizonTask(duration=20.0, horizons=(5,)),
    )
    return paper_scenario().model_copy(update={"plant": "kinematic", "tasks": tasks, **changes})
