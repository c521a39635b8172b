"""Identification of gains, lag and delay of the drive while the robot moves."""
