"""Plan on a map: search, smooth, time; the same as `omnidrive plan`."""

import omnidrive as od

robot = od.named_robot("paper")
grid = od.paper_map()  # or od.load_map(Path("depot.yaml"))
plan = od.plan(
    grid, od.Place(1.0, 1.0), od.Place(8.0, 6.0, yaw=0.0), inflation=0.0, options=od.PathOptions()
)
reference = od.time_within_limits(plan.spline, robot.chassis, od.MotionLimits.of_robot(robot))
print(f"{len(plan.found.cells)} cells, {plan.way.length:.3f} m; smooth {plan.spline.length:.3f} m")
print(f"{plan.clearance:.3f} m from the inflated obstacles at least, for certain")
print(f"{reference.duration:.3f} s; after 1 s: {reference.at(1.0)}")
for limit, share in reference.limit_usage.items():
    print(f"{limit}: {100 * share:.1f} % used")
