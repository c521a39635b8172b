"""Simulation in MuJoCo: robot models, plant, disturbances and obstacles."""
