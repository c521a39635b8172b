"""Observer of the motion from measured poses and earlier commands, for predictive control."""
