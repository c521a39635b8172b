"""Plan a path on a map, smooth it and time it; equivalent to `omnidrive plan`."""

import omnidrive as od

robot = od.named_robot("paper")
grid = od.paper_map()  # or od.load_map("depot.yaml")
plan = od.plan(
    grid, od.Waypoint(1, 1), od.Waypoint(8, 6, yaw=0.0), inflation=0.0, options=od.PathOptions()
)
reference = od.time_within_limits(plan.spline, robot.chassis, od.MotionLimits.of_robot(robot))
print(f"{len(plan.grid_path.poses)} cells, {plan.grid_path.length:.3f} m")
print(f"smooth: {plan.spline.length:.3f} m")
print(f"at least {plan.clearance:.3f} m from the inflated obstacles, as proved")
print(f"{reference.duration:.3f} s; after 1 s: {reference.at(1.0)}")
for limit, share in reference.limit_usage.items():
    print(f"{limit}: {100 * share:.1f} % used")
