"""Simulate one run with physics and print its errors; equivalent to `omnidrive run`."""

import omnidrive as od

robot = od.named_robot("paper")
plan = od.plan(
    od.paper_map(), od.Waypoint(1, 1, 0), od.Waypoint(8, 6), inflation=0.0, options=od.PathOptions()
)
reference = od.time_uniformly(plan.spline, 20.0, robot.chassis)
run = od.simulate(
    od.MujocoPlant(robot),
    od.FeedforwardController(dt=0.1),
    reference,
    start=reference.at(0.0).pose,
    dt=0.1,
).raise_if_failed()
metrics = od.measure(run, robot.chassis)
print(f"ME {metrics.me * 1e3:.2f} mm, MAE {metrics.mae * 1e3:.2f} mrad")
print(f"after the first 2 s: {metrics.me_after_start * 1e3:.2f} mm")
