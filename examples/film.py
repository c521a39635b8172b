"""Write a video of a run; equivalent to `omnidrive run --video`. A GIF needs no encoder."""

import numpy as np

import omnidrive as od

robot = od.named_robot("kiwi")
poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.3, 0.5], [1.0, -0.3, 1.0], [1.5, 0.0, 1.5]])
reference = od.SampledReference.through(np.array([0.0, 1.0, 2.0, 3.0]), poses)
recorder = od.Recorder()
run = od.simulate(
    od.observe(od.MujocoPlant(robot, "ball"), robot, reference, [recorder]),
    od.FeedforwardController(dt=0.05),
    reference,
    start=reference.at(0.0).pose,
    dt=0.05,
)
od.film(recorder.recording, "kiwi.gif", size=(320, 180))
print(f"{run.outcome.value}; {len(recorder.recording.t)} frames in kiwi.gif")
