"""Timing along a path within limits of speed, acceleration and jerk."""
