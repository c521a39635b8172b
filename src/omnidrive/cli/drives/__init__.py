"""Commands of real robots: drives, logs and ROS 2."""
