"""Plan on a map: search, smooth, time; the same as `omnidrive plan`."""

import omnidrive as od

robot = od.named_robot("paper")
grid = od.paper_map()  # or od.load_nav2_map(Path("depot.yaml"))
path, spline = od.plan(
    grid, od.Place(1.0, 1.0), od.Place(8.0, 6.0, yaw=0.0), inflation=0.0, options=od.PathOptions()
)
reference = od.time_uniformly(spline, 20.0, robot.chassis)
print(f"{len(path.poses)} cells, {path.length:.3f} m; smooth {spline.length:.3f} m")
print(f"after 10 s: {reference.at(10.0)}")
