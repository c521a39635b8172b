"""The robot in MuJoCo: models, plant, disturbances, obstacles."""
