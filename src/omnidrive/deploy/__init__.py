"""Drive a robot with the pipeline that was simulated."""
