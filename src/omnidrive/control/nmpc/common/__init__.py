"""Parts that the unicycle's and the holonomic robot's NMPC share."""
