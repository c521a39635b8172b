"""Components: controllers, plants, robots, maps, estimators and references, found by name."""
